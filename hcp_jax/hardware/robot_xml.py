"""XML of robot files, which may be hostile: what is refused before MuJoCo reads it."""

import itertools
import pathlib
import xml.etree.ElementTree as ElementTree
from xml.parsers import expat

from hcp_jax.errors import UserError, one_line

MAX_BYTES = 20_000_000


class RobotFileError(UserError):
    """A robot file cannot be read as a serial arm."""


def parse_xml(path: pathlib.Path) -> ElementTree.Element:
    """The root of a URDF or MJCF file, or of one that it includes.

    Document types are refused: with them a short file can expand without bound.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RobotFileError(f"larger than {MAX_BYTES / 1e6:.0f} MB")
        text = path.read_bytes()
    except OSError as error:
        raise RobotFileError(error.strerror or "cannot be read") from error

    def refuse(*_):
        raise RobotFileError("has a document type declaration (<!DOCTYPE ...>), which is not allowed")

    checker = expat.ParserCreate()
    checker.StartDoctypeDeclHandler = refuse
    try:
        checker.Parse(text, True)
        root = ElementTree.fromstring(text)
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        if isinstance(error, RobotFileError):
            raise
        raise RobotFileError(f"not XML ({one_line(error)})") from error
    if any("xacro}" in element.tag for element in root.iter()):  # in the namespace of that name
        raise RobotFileError("is a xacro template: expected what `xacro FILE` makes of it")
    return root


def check_references(path: pathlib.Path, root: ElementTree.Element) -> None:
    """Raises RobotFileError where an MJCF file, or one that it includes or attaches, refers to one outside its folder."""
    _check_model(path.parent.resolve(), path, root, ())


def _check_model(folder: pathlib.Path, path: pathlib.Path, root: ElementTree.Element, outer: tuple[pathlib.Path, ...]) -> None:
    """Checks one model, a file with what it includes; those that it attaches, `outer` among them, are models of their own."""
    parts = _read_parts(folder, path, root)
    elements = [element for part in parts.values() for element in part.iter()]
    # A later compiler, of an included file too, replaces what it names of an earlier one's; and what an included file names may
    # be beside it or beside the model. Whatever MuJoCo takes is among these.
    places = {part.parent for part in parts}
    directories = {""}
    for compiler in (element for element in elements if _tag(element) == "compiler"):
        directories |= {compiler.get(name, "") for name in ("meshdir", "texturedir", "assetdir")}
    for element, place, directory in itertools.product(elements, places, directories):
        _targets_inside(folder, place / directory, element)
    attached = (element for element in elements if _tag(element) == "model")
    for element, place in itertools.product(attached, places):
        for target in filter(pathlib.Path.exists, _targets_inside(folder, place, element)):
            if target.resolve() in (path.resolve(), *outer):
                raise RobotFileError(f"<model file={target.name!r}> attaches itself")
            model = parse_xml(target)
            if model.tag != "mujoco":
                raise RobotFileError(f"<model file={target.name!r}> starts with <{model.tag}>: expected <mujoco>")
            _check_model(folder, target, model, (*outer, path.resolve()))


def _read_parts(folder: pathlib.Path, path: pathlib.Path, root: ElementTree.Element) -> dict[pathlib.Path, ElementTree.Element]:
    """The roots of a file and of all that it includes, by path; MuJoCo refuses what is included twice."""
    parts, waiting = {path: root}, [root]
    while waiting:
        includes = [element for element in waiting.pop().iter() if _tag(element) == "include"]
        for element, place in itertools.product(includes, {part.parent for part in parts}):
            for target in filter(pathlib.Path.exists, _targets_inside(folder, place, element)):
                if target not in parts:
                    parts[target] = parse_xml(target)
                    waiting.append(parts[target])
    return parts


def _targets_inside(folder: pathlib.Path, place: pathlib.Path, element: ElementTree.Element) -> list[pathlib.Path]:
    """The files that an element names, as seen from `place`. Raises RobotFileError for one outside `folder`."""
    # `file`, and `fileright` and the like of textures
    names = {key: name for key, name in element.attrib.items() if key.startswith("file") and name}
    for key, name in names.items():
        if not (place / name).resolve().is_relative_to(folder):
            raise RobotFileError(f"<{_tag(element)} {key}={name!r}> is outside the file's folder")
    return [place / name for name in names.values()]


def _tag(element: ElementTree.Element) -> str:
    """As MuJoCo sees it, which knows no namespaces."""
    return element.tag.rpartition("}")[2]

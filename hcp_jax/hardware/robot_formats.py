"""URDF and MJCF files as MuJoCo specs of bodies, joints and inertias, without pictures."""

import math
import pathlib
import xml.etree.ElementTree as ElementTree
from xml.parsers import expat

import mujoco
import numpy as np

from hcp_jax.errors import UserError, one_line

MAX_BYTES = 20_000_000
MAX_ROUNDING = 0.01  # share of a link's largest moment of inertia that digits left out may have made too much of it


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


def load_robot_spec(path: pathlib.Path, notes: list[str]) -> tuple[mujoco.MjSpec, dict[str, str]]:
    """Reads a URDF or MJCF file.

    Args:
        path: the file.
        notes: gets a line for what is left out.

    Returns:
        bodies, joints and inertias; and of each joint that another one moves, that one's name.

    Raises:
        RobotFileError: the file is neither, or refers to files outside its folder.
    """
    root = parse_xml(path)
    if root.tag == "robot":
        mimics = {
            joint.get("name", ""): mimic.get("joint", "") for joint in root.iter("joint") for mimic in joint.iter("mimic")
        }
        spec = load_urdf(root)
        relax_inertias(spec, notes)
        return spec, mimics
    if root.tag != "mujoco":
        raise RobotFileError(f"starts with <{root.tag}>: expected <robot> (URDF) or <mujoco> (MJCF)")
    spec = load_mjcf(path, root, notes)
    relax_inertias(spec, notes)
    joint_constraints = [equality for equality in spec.equalities if equality.type == mujoco.mjtEq.mjEQ_JOINT]
    return spec, {equality.name1: equality.name2 or "a constant" for equality in joint_constraints}


def load_urdf(root: ElementTree.Element) -> mujoco.MjSpec:
    """Links, joints and inertias of a URDF; MuJoCo reads them."""
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for link in root.iter("link"):
        for picture in [child for child in link if child.tag != "inertial"]:
            link.remove(picture)
    for joint in root.iter("joint"):
        name, limit = joint.get("name"), joint.find("limit")
        if joint.get("type") == "continuous" and limit is not None:
            for side in ("lower", "upper"):
                limit.attrib.pop(side, None)
        if joint.get("type") == "revolute":
            check_limits(name or "", limit)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", {"fusestatic": "false", "discardvisual": "false"})
    return load_spec(ElementTree.tostring(root, encoding="unicode"))


def check_limits(joint: str, limit: ElementTree.Element | None) -> None:
    """Raises RobotFileError unless a revolute joint has a lower limit below an upper one; MuJoCo takes others for none."""
    low, high = ("0" if limit is None else limit.get(side, "0") for side in ("lower", "upper"))
    try:
        is_range = -math.inf < float(low) < float(high) < math.inf
    except ValueError:
        is_range = False
    if not is_range:
        raise RobotFileError(
            f"joint {joint}: revolute with limits {low} to {high}: expected a lower and a larger upper one, or continuous"
        )


def load_spec(text: str) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_string(text)
    except (ValueError, mujoco.FatalError) as error:
        raise RobotFileError(one_line(error)) from error


def load_mjcf(path: pathlib.Path, root: ElementTree.Element, notes: list[str]) -> mujoco.MjSpec:
    """An MJCF file and what it includes, without geoms of meshes that are missing and without pictures."""
    check_references(path.parent.resolve(), path.parent, root, set())
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise RobotFileError(one_line(error)) from error
    folder = path.parent / (spec.meshdir or "")
    missing = {mesh.name: mesh for mesh in spec.meshes if mesh.file and not (folder / mesh.file).exists()}
    for body in spec.bodies:
        for geom in list(body.geoms):
            if body.explicitinertial or geom.meshname in missing or geom.type == mujoco.mjtGeom.mjGEOM_HFIELD:
                spec.delete(geom)
            else:
                geom.material = ""
        for site in body.sites:
            site.material = ""
    for mesh in list(spec.meshes):
        if mesh.name in missing or not any(geom.meshname == mesh.name for geom in spec.geoms):
            spec.delete(mesh)
    for picture in [*spec.materials, *spec.textures, *spec.hfields]:
        spec.delete(picture)
    if missing:
        notes.append(f"meshes that are missing: {', '.join(sorted(missing))}")
    return spec


def relax_inertias(spec: mujoco.MjSpec, notes: list[str]) -> None:
    """Lowers the largest moment of inertia of links where it is above the sum of the others by no more than rounding does.

    No body has such moments, and MuJoCo refuses them. A flat link's are at that limit, and the digits of a file, or of turning
    its axes, leave them on either side of it. What is left below it is more than later sums and factors round by.
    """
    for body in spec.bodies[1:]:
        if not body.explicitinertial:
            continue
        is_full = bool(np.isfinite(body.fullinertia[0]))
        if is_full:
            xx, yy, zz, xy, xz, yz = body.fullinertia
            moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            moments, axes = np.array(body.inertia), np.eye(3)
        largest = int(np.argmax(moments))
        others = float(moments.sum() - moments[largest])
        excess = float(moments[largest] - others)
        if not -1e-12 * others < excess <= MAX_ROUNDING * moments[largest]:
            continue
        if excess > 1e-6 * others:
            share = 100.0 * excess / float(moments[largest])
            notes.append(
                f"inertia of link {body.name} lowered by {share:.2g} %: it was above what a body can have (A + B >= C)"
            )
        moments[largest] = others * (1.0 - 1e-9)
        if is_full:
            tensor = axes @ np.diag(moments) @ axes.T
            body.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        else:
            body.inertia = moments


def check_references(folder: pathlib.Path, where: pathlib.Path, root: ElementTree.Element, seen: set[pathlib.Path]) -> None:
    """Raises RobotFileError where a file refers to one outside `folder`, and follows its includes."""
    compiler = root.find("compiler")
    directories = [compiler.get(name, "") for name in ("meshdir", "texturedir", "assetdir")] if compiler is not None else []
    for element in root.iter():
        name = element.get("file")
        if not name:
            continue
        for directory in ("", *directories):
            target = (where / directory / name).resolve()
            if not target.is_relative_to(folder):
                raise RobotFileError(f"<{element.tag} file={name!r}> is outside the file's folder")
        target = (where / name).resolve()
        if element.tag == "include":
            if target in seen:
                raise RobotFileError(f"<include file={name!r}> includes itself")
            seen.add(target)
            if target.exists():
                check_references(folder, where, parse_xml(target), seen)

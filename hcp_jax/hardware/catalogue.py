"""Arms by name or by file: those that come with the package are in `robots/catalogue/` (sources: `robots/README.md`)."""

import pathlib

from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.robot_file import RobotFile, RobotFileError, read_robot, read_saved_robot


def catalogue_names() -> tuple[str, ...]:
    """In alphabetical order."""
    return tuple(sorted(path.stem for path in (robots_path() / "catalogue").glob("*.urdf")))


def find_robot(name: str | pathlib.Path) -> pathlib.Path:
    """The file of an arm: the catalogue's of that name, or `name` itself as a path.

    Raises:
        RobotFileError: there is neither.
    """
    if str(name) in catalogue_names():
        return robots_path() / "catalogue" / f"{name}.urdf"
    path = pathlib.Path(name)
    if not str(name) or not path.exists():
        known = ", ".join(catalogue_names())
        raise RobotFileError(f"{str(name) or 'no name'}: no such file, and no arm of the catalogue: {known}")
    return path


def load_robot(name: str | pathlib.Path, base: str | None = None, tip: str | None = None) -> RobotFile:
    """`read_robot` of an arm of the catalogue, by its name, or of a file; or the arm that `save_robot` wrote, whose base and
    tip are chosen already.

    Raises:
        RobotFileError: there is no such arm, it cannot be read, or `base` or `tip` is given for a saved one.
    """
    path = find_robot(name)
    if path.suffix != ".json":
        return read_robot(path, base, tip)
    if base or tip:
        raise RobotFileError(f"{path}: was saved with its base and tip; expected neither --base nor --tip")
    return read_saved_robot(path)

"""The run folder: what is written at its start, and what is checked before anything is."""

import contextlib
import dataclasses
import fcntl
import importlib.metadata
import json
import os
import pathlib
import platform
import subprocess
import sys
from collections.abc import Iterator

import jax

from hcp_jax.config import Config, from_dict, to_dict
from hcp_jax.devices import count_cores
from hcp_jax.errors import UserError
from hcp_jax.experiment.arm import load_own_robot
from hcp_jax.hardware.catalogue import catalogue_names
from hcp_jax.hardware.robot_file import describe_robot, save_robot

CONFIG_FILE = "config.json"
ENVIRONMENT_FILE = "environment.json"
CHECKPOINT_FOLDER = "checkpoints"
POLICY_FILE = "policy.msgpack"  # of a published policy, which has no checkpoints
LOCK_FILE = ".lock"
ROBOT_FOLDER = "robot"  # of a run on somebody's arm: what its file said when the run started
# Fields that a resumed run may change.
_CHANGEABLE = {"total_env_steps", "keep_checkpoints"}
_OF_ARM = ("robot", "robot_base", "robot_tip")
_PACKAGES = ("jax", "jaxlib", "mujoco", "mujoco-mjx", "warp-lang", "brax", "flax", "optax", "orbax-checkpoint", "numpy")


class RunFolderError(UserError):
    """The run folder exists, is missing, is empty or holds another run."""


def check_new(folder: pathlib.Path) -> None:
    """Raises RunFolderError if `folder` holds anything but a lock."""
    if folder.exists() and (not folder.is_dir() or any(path.name != LOCK_FILE for path in folder.iterdir())):
        raise RunFolderError(f"--out={folder}: already exists; choose another folder, or continue it with --resume")


def check_resumable(folder: pathlib.Path, config: Config) -> None:
    """Raises RunFolderError unless `folder` holds a run, not a published policy, of this config (`_CHANGEABLE` aside)."""
    saved = read_config(folder)
    if (folder / POLICY_FILE).exists():
        raise RunFolderError(f"--resume: {folder} is a published policy; start a new run from it with --config.init={folder}")
    for name, old, new in find_differences(saved, config):
        if name in _OF_ARM and is_own_file(saved) and is_own_file(config):
            raise RunFolderError(f"--resume: {folder} was started with another arm than robot={config.robot!r} is now")
        is_left_to_check_physics = name == "physics" and "auto" in (old, new) and read_physics(folder)
        if name not in _CHANGEABLE and not is_left_to_check_physics:
            raise RunFolderError(f"--resume: {folder} was started with {name}={old!r}, not {new!r}")


def check_physics(folder: pathlib.Path, physics: str) -> None:
    """Raises RunFolderError if the run in `folder` was started on another engine than `physics`, as far as it is recorded."""
    started = read_physics(folder)
    if started and started != physics:
        how = f"--config.physics={started} goes on with it"
        raise RunFolderError(f"--resume: {folder} was started on the engine {started}, and here it is {physics}; {how}")


def find_differences(one: Config, other: Config) -> list[tuple[str, object, object]]:
    """Dotted names of the fields in which two configs differ, with both values; None is that of a field which one lacks.

    Of an arm from a file counts what the file says, not where it is. Raises RobotFileError where it cannot be read.
    """
    old, new = _flatten(to_dict(one)), _flatten(to_dict(other))
    same = _OF_ARM if identify_arm(one) == identify_arm(other) else ()
    return [(name, old.get(name), new.get(name)) for name in old | new if name not in same and old.get(name) != new.get(name)]


def identify_arm(config: Config) -> dict:
    """What `config.robot` is: a name of the catalogue with base and tip, empty ones of no arm, or what somebody's file says.

    Raises RobotFileError.
    """
    if is_own_file(config):
        return describe_robot(load_own_robot(config))
    return {name: getattr(config, name) for name in _OF_ARM}


def is_own_file(config: Config) -> bool:
    """Whether `config.robot` is somebody's file, and neither a name of the catalogue nor empty."""
    return config.robot not in ("", *catalogue_names())


@contextlib.contextmanager
def lock(folder: pathlib.Path) -> Iterator[None]:
    """Keeps other processes from writing into `folder`, which is made if it is missing. The system frees it when this one ends.

    Raises:
        RunFolderError: another process is writing there; nothing was changed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK_FILE).open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.seek(0)
            raise RunFolderError(f"--out={folder}: process {file.read().strip() or '?'} is training there") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield


def read_config(folder: pathlib.Path) -> Config:
    """The config of a run folder, whose `robot` is the folder's own copy of somebody's arm.

    Raises:
        RunFolderError: there is none, or none that can be read.
    """
    path = folder / CONFIG_FILE
    if not folder.is_dir():
        raise RunFolderError(f"{folder}: no such run folder")
    if not path.exists():
        raise RunFolderError(f"{folder}: not a run folder (it has no {CONFIG_FILE})")
    try:
        config = from_dict(Config, json.loads(path.read_text()))
    except (ValueError, TypeError) as error:
        raise RunFolderError(f"{path}: damaged or of another version ({error})") from error
    saved = saved_robot_path(folder, config)
    return dataclasses.replace(config, robot=str(saved), robot_base="", robot_tip="") if saved.exists() else config


def read_physics(folder: pathlib.Path) -> str | None:
    """The engine that a run was started on, or None where a kill kept that from being recorded."""
    try:
        return json.loads((folder / ENVIRONMENT_FILE).read_text()).get("physics")
    except (OSError, ValueError):
        return None


def saved_robot_path(folder: pathlib.Path, config: Config) -> pathlib.Path:
    """Where a run folder keeps the arm that `config.robot` names, if that is somebody's file."""
    return folder / ROBOT_FOLDER / f"{pathlib.Path(config.robot).stem}.json"


def write_start(folder: pathlib.Path, config: Config, physics: str) -> None:
    """Writes `config.json`, `environment.json`, and what the file of somebody's arm says."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / CONFIG_FILE).write_text(json.dumps(to_dict(config), indent=2) + "\n")
    (folder / ENVIRONMENT_FILE).write_text(json.dumps(describe_environment(physics), indent=2) + "\n")
    if is_own_file(config):
        save_robot(load_own_robot(config), saved_robot_path(folder, config))


def write_changes(folder: pathlib.Path, config: Config) -> None:
    """Records what a resumed run changes (`_CHANGEABLE`) in its `config.json`, in one step."""
    path = folder / CONFIG_FILE
    saved = json.loads(path.read_text())
    changed = saved | {name: getattr(config, name) for name in _CHANGEABLE}
    if changed != saved:
        temporary = path.with_suffix(".tmp")
        temporary.write_text(json.dumps(changed, indent=2) + "\n")
        temporary.replace(path)


def describe_environment(physics: str) -> dict:
    """Versions, device and commit, for the record."""
    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = None
    return {
        "commit": read_commit(),
        "command": sys.argv,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu": read_cpu_name(),
        "cpu_cores": count_cores(),
        "devices": [f"{device.platform}:{device.device_kind}" for device in jax.devices()],
        "physics": physics,
        "versions": versions,
    }


def read_cpu_name() -> str:
    """The processor's model as Linux names it, elsewhere its architecture."""
    path = pathlib.Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def read_commit() -> str | None:
    """Commit of the checkout this package stands in, with `+` if it has local changes; None outside a checkout."""
    root = pathlib.Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    try:
        git = ["git", "-C", str(root)]
        commit = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
        changes = subprocess.run([*git, "status", "--porcelain", "-uno"], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return commit + ("+" if changes.stdout.strip() else "")


def _flatten(values: dict, path: str = "") -> dict:
    flat = {}
    for name, value in values.items():
        if isinstance(value, dict):
            flat |= _flatten(value, f"{path}{name}.")
        else:
            flat[f"{path}{name}"] = list(value) if isinstance(value, tuple) else value
    return flat

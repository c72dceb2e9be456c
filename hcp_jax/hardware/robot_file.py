"""An arm from somebody's URDF or MJCF file: its serial chain, and what was fixed or assumed on the way.

Files may be damaged or hostile: they are read in a process of their own, with a time limit. Pictures are not needed, so meshes
may be missing; those that are there are read only for the masses of links that state none.
"""

import dataclasses
import itertools
import json
import pathlib
import subprocess
import sys

import mujoco
import numpy as np

from hcp_jax.errors import one_line
from hcp_jax.hardware.chain import Chain, read_chain
from hcp_jax.hardware.robot_checks import (
    check_chain,
    check_joints,
    check_masses,
    check_ties,
    find_ties,
    note_other_forces,
)
from hcp_jax.hardware.robot_formats import load_robot_spec
from hcp_jax.hardware.robot_xml import RobotFileError

MAX_SECONDS = 9.0
_TIP_SITE = "hcp_jax tip"  # a name that no file has
_MIN_TILT = 0.1  # [degrees] of a base's z that is worth a word


@dataclasses.dataclass(frozen=True)
class RobotFile:
    """What a file says about an arm.

    Attributes:
        chain: the arm.
        joints: names of its joints, base first.
        base, tip: links that it starts and ends at; the tip's origin is the point of interest.
        notes: a line for everything that was fixed, dropped or assumed.
    """

    chain: Chain
    joints: tuple[str, ...]
    base: str
    tip: str
    notes: tuple[str, ...]


def read_robot(path: str | pathlib.Path, base: str | None = None, tip: str | None = None) -> RobotFile:
    """Reads a URDF or MJCF file.

    Args:
        path: the file.
        base: link that is taken for the world; by default the file's root. Joints before it are fixed.
        tip: last link; by default the end of the one chain of hinges.

    Raises:
        RobotFileError: the file is no robot, no serial arm of at most seven limited hinges with masses, refers to files outside
            its folder, or takes longer than `MAX_SECONDS`.
    """
    path = pathlib.Path(path)
    command = [sys.executable, "-m", "hcp_jax.hardware.robot_file", str(path.resolve()), json.dumps([base, tip])]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise RobotFileError(f"{path}: not read within {MAX_SECONDS:.0f} s") from None
    try:
        answer = json.loads(done.stdout.strip().splitlines()[-1])
    except (IndexError, ValueError):
        why = "".join(f": {line.strip()}" for line in done.stderr.strip().splitlines()[-1:])
        raise RobotFileError(f"{path}: reading it ended without an answer (exit code {done.returncode}){why}") from None
    if "error" in answer:
        raise RobotFileError(f"{path}: {answer['error']}")
    return parse_robot(answer)


def describe_robot(robot: RobotFile) -> dict:
    """All of it, for JSON."""
    chain = {field.name: getattr(robot.chain, field.name).tolist() for field in dataclasses.fields(robot.chain)}
    return {"chain": chain, "joints": robot.joints, "base": robot.base, "tip": robot.tip, "notes": robot.notes}


def parse_robot(values: dict) -> RobotFile:
    """The inverse of `describe_robot`. Raises RobotFileError."""
    try:
        chain = Chain(**{name: np.asarray(rows, np.float64) for name, rows in values["chain"].items()})
        joints, base, tip, notes = (values[name] for name in ("joints", "base", "tip", "notes"))
        is_whole = len(joints) == chain.num_joints and chain.is_consistent()
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise RobotFileError("damaged record of an arm") from error
    if not is_whole:
        raise RobotFileError("damaged record of an arm")
    return RobotFile(chain, tuple(map(str, joints)), str(base), str(tip), tuple(map(str, notes)))


def save_robot(robot: RobotFile, path: pathlib.Path) -> None:
    """Writes an arm as JSON, in a folder that is made if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(describe_robot(robot), indent=2) + "\n")


def read_saved_robot(path: pathlib.Path) -> RobotFile:
    """The arm that `save_robot` wrote. Raises RobotFileError."""
    try:
        return parse_robot(json.loads(path.read_text()))
    except OSError as error:
        raise RobotFileError(f"{path}: {error.strerror or 'cannot be read'}") from error
    except ValueError as error:  # RobotFileError among them
        raise RobotFileError(f"{path}: damaged record of an arm") from error


def read_robot_here(path: pathlib.Path, base: str | None, tip: str | None) -> RobotFile:
    """`read_robot` in this process, which a hostile file may take down."""
    notes: list[str] = []
    spec, moved_by = load_robot_spec(path, notes)
    links = [body.name for body in spec.bodies[1:]]
    for role, name in (("base", base), ("tip", tip)):
        if name is not None and name not in links:
            raise RobotFileError(f"--{role}={name}: no such link; there are {', '.join(links)}")
    ties = find_ties(spec)
    remove_all_but_bodies(spec, notes)
    tip_body = spec.body(tip) if tip else find_tip(spec)
    path_bodies = bodies_towards(tip_body)
    base_body = spec.body(base) if base else path_bodies[0]
    if base_body not in path_bodies:
        raise RobotFileError(f"--base={base}: not between the root and {tip_body.name}")
    moving = path_bodies[path_bodies.index(base_body) + (1 if base else 0) :]
    fix_joints(spec, moving, notes)
    check_joints(moving, moved_by)
    check_ties(ties, notes)
    check_masses(moving)
    note_other_forces(spec, moving, notes)
    tip_body.add_site(name=_TIP_SITE)
    try:
        model = spec.compile()
        chain = read_chain(model, _TIP_SITE)
    except (ValueError, mujoco.FatalError) as error:  # ChainError among them
        raise RobotFileError(one_line(error)) from error
    joints = [joint for body in moving for joint in body.joints]
    chain = check_chain(chain, model, joints, notes)
    if base:
        chain = relative_to(chain, model, base_body.name, notes)
    stands_on = spec.worldbody if base_body.joints else base_body
    return RobotFile(chain, tuple(j.name for j in joints), stands_on.name, tip_body.name, tuple(notes))


def remove_all_but_bodies(spec: mujoco.MjSpec, notes: list[str]) -> None:
    """Deletes what refers to joints and is not needed: only bodies, joints and motors of joints are left."""
    if spec.tendons:
        notes.append(f"tendons left out: {', '.join(tendon.name or 'one without a name' for tendon in spec.tendons)}")
    kinds = ("keys", "equalities", "tendons", "sensors", "excludes", "pairs", "cameras", "lights", "skins", "flexes")
    for actuator in list(spec.actuators):
        if actuator.trntype != mujoco.mjtTrn.mjTRN_JOINT:
            spec.delete(actuator)
    for kind in kinds:
        for element in list(getattr(spec, kind, ())):
            spec.delete(element)


def find_tip(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """The last link of the one chain of hinges, before any other joint that follows them.

    Raises:
        RobotFileError: there is none, or there are several.
    """
    parents = {body.name: body.parent.name if body.parent else None for body in spec.bodies}
    leaves = [body for body in spec.bodies[1:] if body.name not in parents.values()]
    hinges = {leaf.name: hinge_names(bodies_towards(leaf)) for leaf in leaves}
    longest = max(hinges.values(), key=len, default=())
    if not longest:
        raise RobotFileError("has no hinge joints")
    for name, chain in hinges.items():
        if chain != longest[: len(chain)]:
            other = next(leaf for leaf, names in hinges.items() if names == longest)
            raise RobotFileError(f"branches: to {other} and to {name}; choose one end with --tip")
    ends = [bodies_towards(leaf) for leaf in leaves if hinges[leaf.name] == longest]
    common = [bodies[0] for bodies in zip(*ends, strict=False) if all(body.name == bodies[0].name for body in bodies)]
    last = max(index for index, body in enumerate(common) if hinge_names([body]))
    after = itertools.takewhile(lambda body: not body.joints, common[last + 1 :])
    return [common[last], *after][-1]


def hinge_names(bodies: list[mujoco.MjsBody]) -> tuple[str, ...]:
    return tuple(j.name for body in bodies for j in body.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE)


def bodies_towards(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """From the first body in the world to `body`."""
    bodies = []
    while body.parent is not None:
        bodies.append(body)
        body = body.parent
    return bodies[::-1]


def fix_joints(spec: mujoco.MjSpec, moving: list[mujoco.MjsBody], notes: list[str]) -> None:
    """Deletes every joint that is not on a body of `moving`, and the arm's own free joint; says so."""
    moving_names = {body.name for body in moving}
    fixed = []
    for body in spec.bodies:
        for joint in list(body.joints):
            if body.name not in moving_names or joint.type == mujoco.mjtJoint.mjJNT_FREE:
                fixed.append(joint.name)
                for actuator in [a for a in spec.actuators if a.target == joint.name]:
                    spec.delete(actuator)
                spec.delete(joint)
    if fixed:
        notes.append(f"joints fixed where the file has them: {', '.join(fixed)}")


def relative_to(chain: Chain, model: mujoco.MjModel, base: str, notes: list[str]) -> Chain:
    """The chain with body `base` at the world's origin; says so where gravity pulls along another of its axes then."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    body = data.body(base)
    tilt = np.degrees(np.arccos(np.clip(body.xmat[8], -1.0, 1.0)))  # of its z
    if tilt > _MIN_TILT:
        notes.append(
            f"base {base} is turned by {tilt:.3g} degrees against the file's world: gravity then pulls along the base's -z"
        )
    inverse, position, quat = np.zeros(4), np.zeros(3), np.zeros(4)
    mujoco.mju_negQuat(inverse, body.xquat)
    mujoco.mju_rotVecQuat(position, chain.pos[0] - body.xpos, inverse)
    mujoco.mju_mulQuat(quat, inverse, chain.quat[0])
    return dataclasses.replace(
        chain, pos=np.concatenate([position[None], chain.pos[1:]]), quat=np.concatenate([quat[None], chain.quat[1:]])
    )


def main() -> None:
    path, (base, tip) = sys.argv[1], json.loads(sys.argv[2])
    try:
        answer = describe_robot(read_robot_here(pathlib.Path(path), base, tip))
    except (ValueError, mujoco.FatalError) as error:  # RobotFileError among them
        answer = {"error": one_line(error)}
    print(json.dumps(answer))


if __name__ == "__main__":
    main()

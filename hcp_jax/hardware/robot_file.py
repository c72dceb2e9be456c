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
import xml.etree.ElementTree as ElementTree
from xml.parsers import expat

import mujoco
import numpy as np

from hcp_jax.errors import UserError, one_line
from hcp_jax.hardware.chain import MAX_JOINTS, Chain, ChainError, read_chain

MAX_BYTES = 20_000_000
MAX_SECONDS = 9.0
# What is assumed where a file says nothing: [N m] of joint 0 to 6, as the arms that policies were trained on; [N m s/rad],
# [kg m^2]. A geared joint has both: without them a light wrist accelerates by 1000 rad/s^2, and 4 ms steps diverge.
ASSUMED_TORQUE_LIMITS = (80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0)
ASSUMED_DAMPING, ASSUMED_ARMATURE = 1.0, 0.1
_TIP_SITE = "hcp_jax tip"  # a name that no file has
_MIN_INERTIA = 1e-12  # [kg], [kg m^2]


class RobotFileError(UserError):
    """A robot file cannot be read as a serial arm."""


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
        raise RobotFileError(f"{path}: MuJoCo ended without an answer (exit code {done.returncode})") from None
    if "error" in answer:
        raise RobotFileError(f"{path}: {answer['error']}")
    chain = Chain(**{name: np.asarray(values, np.float64) for name, values in answer["chain"].items()})
    return RobotFile(chain, tuple(answer["joints"]), answer["base"], answer["tip"], tuple(answer["notes"]))


def read_robot_here(path: pathlib.Path, base: str | None, tip: str | None) -> RobotFile:
    """`read_robot` in this process, which a hostile file may take down."""
    notes: list[str] = []
    root = parse_xml(path)
    if root.tag not in ("robot", "mujoco"):
        raise RobotFileError(f"starts with <{root.tag}>: expected <robot> (URDF) or <mujoco> (MJCF)")
    spec = load_urdf(root) if root.tag == "robot" else load_mjcf(path, root, notes)
    name_all(spec)
    names = [body.name for body in spec.bodies]
    for role, name in (("base", base), ("tip", tip)):
        if name is not None and name not in names:
            raise RobotFileError(f"--{role}={name}: no such link; there are {', '.join(names[1:])}")
    remove_all_but_bodies(spec)
    tip_body = spec.body(tip) if tip else find_tip(spec)
    path_bodies = bodies_towards(spec, tip_body)
    base_body = spec.body(base) if base else path_bodies[0]
    if base_body not in path_bodies:
        raise RobotFileError(f"--base={base}: not between the root and {tip_body.name}")
    moving = path_bodies[path_bodies.index(base_body) + (1 if base else 0) :]
    fix_joints(spec, moving, notes)
    check_masses(spec, moving)
    tip_body.add_site(name=_TIP_SITE)
    try:
        model = spec.compile()
        chain = read_chain(model, _TIP_SITE)
    except (ValueError, mujoco.FatalError) as error:  # ChainError among them
        raise RobotFileError(one_line(error)) from error
    joints = [joint for body in moving for joint in body.joints]
    chain = check_chain(chain, model, joints, notes)
    if base:
        chain = relative_to(chain, model, base_body.name)
    return RobotFile(chain, tuple(j.name for j in joints), base_body.name or "world", tip_body.name, tuple(notes))


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
    return root


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
        if joint.get("type") == "revolute" and (limit is None or limit.get("lower") == limit.get("upper")):
            raise RobotFileError(f"joint {name}: revolute without limits; give them, or make it continuous")
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", {"fusestatic": "false", "discardvisual": "false"})
    return load_spec(ElementTree.tostring(root, encoding="unicode"))


def load_spec(text: str) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_string(text)
    except (ValueError, mujoco.FatalError) as error:
        raise RobotFileError(one_line(error)) from error


def load_mjcf(path: pathlib.Path, root: ElementTree.Element, notes: list[str]) -> mujoco.MjSpec:
    """An MJCF file and what it includes, without geoms of meshes that are missing."""
    check_references(path.parent.resolve(), path.parent, root, set())
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise RobotFileError(one_line(error)) from error
    folder = path.parent / (spec.meshdir or "")
    missing = {mesh.name: mesh for mesh in spec.meshes if mesh.file and not (folder / mesh.file).exists()}
    for body in spec.bodies:
        for geom in list(body.geoms):
            if body.explicitinertial or geom.meshname in missing:
                spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in missing or not any(geom.meshname == mesh.name for geom in spec.geoms):
            spec.delete(mesh)
    if missing:
        notes.append(f"meshes that are missing: {', '.join(sorted(missing))}")
    return spec


def name_all(spec: mujoco.MjSpec) -> None:
    """Names bodies that have no name, as MJCF allows, by number; and joints after their body."""
    bodies, joints = {body.name for body in spec.bodies}, {joint.name for joint in spec.joints}
    for body in spec.bodies[1:]:
        body.name = body.name or next(name for i in itertools.count(1) if (name := f"body{i}") not in bodies)
        bodies.add(body.name)
        for joint in body.joints:
            endings = itertools.chain([""], (f"_{i}" for i in itertools.count(2)))
            joint.name = joint.name or next(name for ending in endings if (name := body.name + ending) not in joints)
            joints.add(joint.name)


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


def remove_all_but_bodies(spec: mujoco.MjSpec) -> None:
    """Deletes what refers to joints and is not needed: only bodies, joints and motors of joints are left."""
    kinds = ("keys", "equalities", "tendons", "sensors", "excludes", "pairs", "cameras", "lights", "skins", "flexes")
    for actuator in list(spec.actuators):
        if actuator.trntype != mujoco.mjtTrn.mjTRN_JOINT:
            spec.delete(actuator)
    for kind in kinds:
        for element in list(getattr(spec, kind, ())):
            spec.delete(element)


def find_tip(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """The last link of the one chain of hinges.

    Raises:
        RobotFileError: there is none, or there are several.
    """
    parents = {body.name: body.parent.name if body.parent else None for body in spec.bodies}
    leaves = [body for body in spec.bodies[1:] if body.name not in parents.values()]
    hinges = {leaf.name: hinge_names(bodies_towards(spec, leaf)) for leaf in leaves}
    longest = max(hinges.values(), key=len, default=())
    if not longest:
        raise RobotFileError("has no hinge joints")
    for name, chain in hinges.items():
        if chain != longest[: len(chain)]:
            other = next(leaf for leaf, names in hinges.items() if names == longest)
            raise RobotFileError(f"branches: to {other} and to {name}; choose one end with --tip")
    ends = [bodies_towards(spec, leaf) for leaf in leaves if hinges[leaf.name] == longest]
    common = [bodies[0] for bodies in zip(*ends, strict=False) if all(body.name == bodies[0].name for body in bodies)]
    return common[-1]


def hinge_names(bodies: list[mujoco.MjsBody]) -> tuple[str, ...]:
    return tuple(j.name for body in bodies for j in body.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE)


def bodies_towards(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
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
        notes.append(f"joints fixed at 0: {', '.join(fixed)}")
    kinds = {mujoco.mjtJoint.mjJNT_SLIDE: "prismatic", mujoco.mjtJoint.mjJNT_BALL: "a ball joint"}
    for body in moving:
        for joint in body.joints:
            if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
                raise RobotFileError(f"joint {joint.name}: is {kinds[joint.type]}; expected hinges between base and tip")
    count = sum(len(body.joints) for body in moving)
    if not 1 <= count <= MAX_JOINTS:
        raise RobotFileError(f"{count} hinges between base and tip: expected 1 to {MAX_JOINTS}")


def check_masses(spec: mujoco.MjSpec, moving: list[mujoco.MjsBody]) -> None:
    """Raises RobotFileError for a moving link that weighs nothing."""
    for body in moving:
        if body.joints and not body.geoms and (body.mass < _MIN_INERTIA or not body.explicitinertial):
            raise RobotFileError(f"link {body.name}: moves and has no mass (no inertia in the file, meshes missing)")


def check_chain(chain: Chain, model: mujoco.MjModel, joints: list, notes: list[str]) -> Chain:
    """The chain with assumptions for what the file leaves open.

    Raises:
        RobotFileError: a value is not finite, an inertia is zero, or a range is empty.
    """
    names = [joint.name for joint in joints]
    for field in dataclasses.fields(chain):
        if not np.isfinite(getattr(chain, field.name)).all():
            raise RobotFileError(f"{field.name}: not finite")
    for name, mass, inertia in zip(names, chain.mass, chain.inertia, strict=True):
        if mass < _MIN_INERTIA or inertia.min() < _MIN_INERTIA:
            raise RobotFileError(f"link moved by joint {name}: mass {mass:g} kg, inertia {inertia.min():g} kg m^2")
    unlimited = [name for name in names if not model.joint(name).limited]
    if unlimited:
        notes.append(f"continuous joints limited to +-pi: {', '.join(unlimited)}")
    if (np.diff(chain.joint_range) <= 0).any():
        raise RobotFileError(f"joint {names[int(np.argmin(np.diff(chain.joint_range)))]}: empty range")
    torque_limit = np.asarray(ASSUMED_TORQUE_LIMITS)[: len(names)]
    filled = {}
    for field, assumed, label in (
        ("torque_limit", torque_limit, "torque limits assumed [N m]"),
        ("damping", np.full(len(names), ASSUMED_DAMPING), "damping assumed [N m s/rad]"),
        ("armature", np.full(len(names), ASSUMED_ARMATURE), "armature assumed [kg m^2]"),
    ):
        is_open = getattr(chain, field) <= 0
        filled[field] = np.where(is_open, assumed, getattr(chain, field))
        if is_open.any():
            values = (f"{name} {value:g}" for name, value in zip(names, filled[field], strict=True))
            notes.append(f"{label}: {', '.join(itertools.compress(values, is_open))}")
    return dataclasses.replace(chain, **filled)


def relative_to(chain: Chain, model: mujoco.MjModel, base: str) -> Chain:
    """The chain with body `base` at the world's origin."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    body = data.body(base)
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
        robot = read_robot_here(pathlib.Path(path), base, tip)
        chain = {field.name: getattr(robot.chain, field.name).tolist() for field in dataclasses.fields(robot.chain)}
        answer = {"chain": chain, "joints": robot.joints, "base": robot.base, "tip": robot.tip, "notes": robot.notes}
    except (RobotFileError, ChainError) as error:
        answer = {"error": one_line(error)}
    print(json.dumps(answer))


if __name__ == "__main__":
    main()

"""What an arm from a file has to be: one open chain of limited hinges that weigh something. The rest is said and assumed."""

import dataclasses
import itertools
from collections.abc import Mapping

import mujoco
import numpy as np

from hcp_jax.hardware.chain import GRAVITY, MAX_JOINTS, Chain
from hcp_jax.hardware.robot_xml import RobotFileError

# What is assumed where a file says nothing: [N m] of joint 0 to 6, as the arms that policies were trained on; [N m s/rad],
# [kg m^2]. A geared joint has both: without them a light wrist accelerates by 1000 rad/s^2, and 4 ms steps diverge.
ASSUMED_TORQUE_LIMITS = (80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0)
ASSUMED_DAMPING, ASSUMED_ARMATURE = 1.0, 0.1
_MIN_INERTIA = 1e-12  # [kg], [kg m^2]


def check_joints(moving: list[mujoco.MjsBody], moved_by: Mapping[str, str]) -> None:
    """Raises RobotFileError unless `moving` has one to seven hinges, none of them moved by another joint."""
    kinds = {mujoco.mjtJoint.mjJNT_SLIDE: "prismatic", mujoco.mjtJoint.mjJNT_BALL: "a ball joint"}
    for body in moving:
        for joint in body.joints:
            if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
                raise RobotFileError(f"joint {joint.name}: is {kinds[joint.type]}; expected hinges between base and tip")
            if joint.name in moved_by:
                raise RobotFileError(f"joint {joint.name}: follows {moved_by[joint.name]}; expected independent joints")
    count = sum(len(body.joints) for body in moving)
    if not 1 <= count <= MAX_JOINTS:
        raise RobotFileError(f"{count} hinges between base and tip: expected 1 to {MAX_JOINTS}")


def find_ties(spec: mujoco.MjSpec) -> list[tuple[mujoco.MjsBody, mujoco.MjsBody]]:
    """The pairs of bodies that a file ties together, beside its joints.

    Raises:
        RobotFileError: there is no such body, or site on one.
    """
    kinds = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    ties = []
    for tie in (equality for equality in spec.equalities if equality.active and equality.type in kinds):
        on_sites = tie.objtype == mujoco.mjtObj.mjOBJ_SITE
        ends = [spec.site(name) if on_sites else spec.body(name or "world") for name in (tie.name1, tie.name2)]
        if None in ends:
            kind = "site" if on_sites else "body"
            raise RobotFileError(f"constraint of {tie.name1} and {tie.name2 or 'world'}: there is no {kind} of that name")
        one, other = (end.parent if on_sites else end for end in ends)
        ties.append((one, other))
    return ties


def check_ties(ties: list[tuple[mujoco.MjsBody, mujoco.MjsBody]], notes: list[str]) -> None:
    """Says which ties to mocap bodies are left out; raises RobotFileError for one between bodies that move apart."""
    for one, other in ties:
        if moved_with(one) == moved_with(other):
            continue
        if not (one.mocap or other.mocap):
            raise RobotFileError(f"link {one.name}: is tied to {other.name} by a constraint; expected an open chain")
        notes.append(f"constraint to a mocap body left out: {one.name} to {other.name}")


def moved_with(body: mujoco.MjsBody) -> mujoco.MjsBody:
    """The body whose joint moves `body`; the world where none does."""
    while body.parent is not None and not body.joints:
        body = body.parent
    return body


def check_masses(moving: list[mujoco.MjsBody]) -> None:
    """Raises RobotFileError for a joint that moves nothing that weighs anything."""
    for body in moving:
        if body.joints and not any(map(may_weigh, moved_by_joint_of(body))):
            raise RobotFileError(f"link {body.name}: moves and has no mass (no inertia in the file, meshes missing)")


def moved_by_joint_of(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """`body` and all that is rigidly attached to it, up to the next joints."""
    rigid = [body]
    for part in rigid:  # which grows
        rigid += [child for child in part.bodies if not child.joints]
    return rigid


def may_weigh(body: mujoco.MjsBody) -> bool:
    return bool(body.geoms) or (body.explicitinertial and body.mass >= _MIN_INERTIA)


def note_other_forces(spec: mujoco.MjSpec, moving: list[mujoco.MjsBody], notes: list[str]) -> None:
    """Says which of a file's forces a chain does not have."""
    sprung = [joint.name for body in moving for joint in body.joints if np.any(joint.stiffness)]
    floating = [body.name for body in moving if body.gravcomp]
    if sprung:
        notes.append(f"springs of joints left out: {', '.join(sprung)}")
    if floating:
        notes.append(f"gravity compensation of links left out: {', '.join(floating)}")
    if not np.allclose(spec.option.gravity, (0.0, 0.0, -GRAVITY)):
        gravity = " ".join(f"{value:g}" for value in spec.option.gravity)
        notes.append(f"gravity of the file left out: {gravity}; policies were trained with {-GRAVITY:g} along z")


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

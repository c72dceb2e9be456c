"""Serial arms of at most seven hinges as one template: the padded chain (DESIGN.md, decision 3).

`read_chain` reduces any MuJoCo model of a serial arm to frames, composite inertias and joint constants. `edit_spec` writes
them into the seven slots of a chain template: active joints first, then slots that are massless and locked. So observations
and actions of every arm have the same size, with zeros at the end where joints are missing (paper, section 4.1).
"""

import dataclasses
import itertools
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

MAX_JOINTS = 7
GRAVITY = 9.81  # [m/s^2] of all our models, along -z
TIP_SITE = "ref_pt"
# [kg m^2] of a padded slot. In 1 s of hard contact it turns by less than 2e-5 rad; at 1e6 the solver's tolerance, which goes
# by the mean inertia, is so loose that the other joints are off by 4e-4 rad.
LOCKED_ARMATURE = 1e4
# [kg], [kg m^2] of a padded slot: MuJoCo wants moving bodies to have some.
_NO_MASS, _NO_INERTIA = 1e-9, 1e-12
# Pose of a padded slot's inertia. Where it is the slot's own, MuJoCo takes shortcuts that are compiled into the model.
_PADDED_COM, _PADDED_INERTIA_QUAT = np.array([0.0, 0.0, 1e-3]), np.array([0.8, 0.6, 0.0, 0.0])


class ChainError(ValueError):
    """A model is not a serial arm of at most seven hinges."""


@dataclasses.dataclass(frozen=True)
class Chain:
    """One serial arm with n joints, at joint angles 0, in SI units.

    Attributes:
        pos, quat: [n + 1, 3], [n + 1, 4] frame of each joint (z along its axis) in that of the joint before it, the first in
            the world; the last is the point of interest.
        mass, com, inertia_quat, inertia: [n], [n, 3], [n, 4], [n, 3] of what each joint moves rigidly, up to the next joint,
            in the joint's frame.
        joint_range: [n, 2] rad; damping, frictionloss, armature: [n]; torque_limit: [n] N m.
    """

    pos: np.ndarray
    quat: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia_quat: np.ndarray
    inertia: np.ndarray
    joint_range: np.ndarray
    damping: np.ndarray
    frictionloss: np.ndarray
    armature: np.ndarray
    torque_limit: np.ndarray

    @property
    def num_joints(self) -> int:
        return len(self.mass)

    def is_consistent(self) -> bool:
        """Whether every field is finite and has a row for each joint, and masses, inertias and ranges are possible."""
        n = self.num_joints
        widths = {"com": (3,), "inertia_quat": (4,), "inertia": (3,), "joint_range": (2,)}
        shapes = {field.name: (n, *widths.get(field.name, ())) for field in dataclasses.fields(self)}
        shapes |= {"pos": (n + 1, 3), "quat": (n + 1, 4)}
        values = {name: getattr(self, name) for name in shapes}
        if not 1 <= n <= MAX_JOINTS or not all(
            values[name].shape == shape and np.isfinite(values[name]).all() for name, shape in shapes.items()
        ):
            return False
        is_body = (self.mass > 0).all() and (self.inertia > 0).all()
        is_body = is_body and (2 * self.inertia.max(axis=1) <= self.inertia.sum(axis=1)).all()  # A + B >= C
        never_negative = (self.damping, self.frictionloss, self.armature, self.torque_limit)
        return bool(is_body and (np.diff(self.joint_range) > 0).all() and all((values >= 0).all() for values in never_negative))

    def padded(self, name: str) -> np.ndarray:
        """Field `name` with zeros for missing joints: [7, ...]. Quaternions are padded with the identity."""
        values = getattr(self, name)
        rows = MAX_JOINTS + (1 if name in ("pos", "quat") else 0)
        result = np.zeros((rows, *values.shape[1:]))
        if name in ("quat", "inertia_quat"):
            result[:, 0] = 1.0
        result[: len(values)] = values
        return result


def read_chain(model: mujoco.MjModel, tip_site: str = TIP_SITE) -> Chain:
    """The chain from the world to the body of `tip_site`. Bodies beside it count as rigid parts of what they hang on.

    Raises:
        ChainError: no such site, more than seven hinges on the way to it, a joint there that is no hinge, or two on a body.
    """
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tip_site)
    if site < 0:
        raise ChainError(f"site {tip_site!r}: the model has none of that name")
    joints = _joints_towards(model, model.site_bodyid[site])
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    frames = [(np.zeros(3), np.eye(3))]
    frames += [
        (data.xanchor[j].copy(), _frame_along(data.xmat[model.jnt_bodyid[j]].reshape(3, 3), data.xaxis[j])) for j in joints
    ]
    frames.append((data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()))
    pos = [before[1].T @ (after[0] - before[0]) for before, after in itertools.pairwise(frames)]
    quat = [_quat_of(before[1].T @ after[1]) for before, after in itertools.pairwise(frames)]
    inertias = [_composite_inertia(model, data, bodies, frames[i + 1]) for i, bodies in enumerate(_groups(model, joints))]
    mass, com, inertia_quat, inertia = (np.asarray(column) for column in zip(*inertias, strict=True))
    dofs = model.jnt_dofadr[joints]
    return Chain(
        pos=np.asarray(pos),
        quat=np.asarray(quat),
        mass=mass,
        com=com,
        inertia_quat=inertia_quat,
        inertia=inertia,
        joint_range=np.where(model.jnt_limited[joints, None], model.jnt_range[joints], [-np.pi, np.pi]),
        damping=model.dof_damping[dofs].copy(),
        frictionloss=model.dof_frictionloss[dofs].copy(),
        armature=model.dof_armature[dofs].copy(),
        torque_limit=np.asarray([_torque_limit(model, joint) for joint in joints]),
    )


def edit_spec(spec: mujoco.MjSpec, chain: Chain) -> None:
    """Writes `chain` into a chain template (`chain_reacher.xml`, `chain_peg.xml`), whose slots beyond it may be gone."""
    n = chain.num_joints
    mass, com = chain.padded("mass"), chain.padded("com")
    inertia_quat, inertia = chain.padded("inertia_quat"), chain.padded("inertia")
    place_bodies(spec, chain.pos, chain.quat)
    for i in range(len(spec.joints)):
        active = i < n
        body, joint = spec.body(f"slot{i}"), spec.joint(f"slot{i}")
        body.mass = mass[i] if active else _NO_MASS
        body.ipos, body.iquat = (com[i], inertia_quat[i]) if active else (_PADDED_COM, _PADDED_INERTIA_QUAT)
        body.inertia = inertia[i] if active else np.full(3, _NO_INERTIA)
        joint.range = chain.joint_range[i] if active else [-1.0, 1.0]
        joint.damping = [chain.damping[i] if active else 0.0, 0, 0]
        joint.frictionloss = chain.frictionloss[i] if active else 0.0
        joint.armature = chain.armature[i] if active else LOCKED_ARMATURE
        gear = np.zeros(6)
        gear[0] = chain.torque_limit[i] if active else 0.0
        spec.actuator(f"slot{i}").gear = gear


def place_bodies(spec: mujoco.MjSpec, pos: np.ndarray, quat: np.ndarray) -> None:
    """Puts the slots of a chain template, and its tool, where an arm of n joints has them: pos [n + 1, 3], quat [n + 1, 4]."""
    for i in range(len(spec.joints)):
        body = spec.body(f"slot{i}")
        body.pos, body.quat = (pos[i], quat[i]) if i < len(pos) - 1 else (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    tool = spec.body("tool")
    tool.pos, tool.quat = pos[-1], quat[-1]


def without_padding(template: str, num_joints: int) -> str:
    """A chain template's MJCF with `num_joints` slots alone, the tool on the last of them."""
    root = ElementTree.fromstring(template)
    if num_joints < MAX_JOINTS:
        parents = {child: parent for parent in root.iter("body") for child in parent}
        bodies = {body.get("name"): body for body in root.iter("body")}
        last, tool = bodies[f"slot{num_joints - 1}"], bodies["tool"]
        parents[tool].remove(tool)
        last.remove(bodies[f"slot{num_joints}"])
        last.append(tool)
        actuators = root.find("actuator")
        assert actuators is not None
        for motor in list(actuators)[num_joints:]:
            actuators.remove(motor)
    return ElementTree.tostring(root, encoding="unicode")


def _joints_towards(model: mujoco.MjModel, body: int) -> list[int]:
    """Hinges from the world to `body`, base first."""
    joints = []
    while body:
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        if count > 1:
            raise ChainError(f"body {model.body(body).name!r}: {count} joints on one body; an arm has one on each")
        if count:
            if model.jnt_type[first] != mujoco.mjtJoint.mjJNT_HINGE:
                raise ChainError(f"joint {model.joint(first).name!r}: not a hinge")
            joints.append(int(first))
        body = model.body_parentid[body]
    if not 1 <= len(joints) <= MAX_JOINTS:
        raise ChainError(f"{len(joints)} hinges on the way to the tip: an arm has 1 to {MAX_JOINTS}")
    return joints[::-1]


def _groups(model: mujoco.MjModel, joints: list[int]) -> list[list[int]]:
    """Bodies that each of `joints` moves rigidly, up to the next of them."""
    slot_of = {int(model.jnt_bodyid[joint]): slot for slot, joint in enumerate(joints)}
    groups: list[list[int]] = [[] for _ in joints]
    for body in range(1, model.nbody):
        ancestor = body
        while ancestor and ancestor not in slot_of:
            ancestor = int(model.body_parentid[ancestor])
        if ancestor:
            groups[slot_of[ancestor]].append(body)
    return groups


def _composite_inertia(model: mujoco.MjModel, data: mujoco.MjData, bodies: list[int], frame: tuple[np.ndarray, np.ndarray]):
    """Mass, centre of mass, principal axes and moments of `bodies` as one, in `frame` (position, rotation) of the world."""
    mass = model.body_mass[bodies].sum()
    if mass <= 0:
        raise ChainError(f"body {model.body(bodies[0]).name!r}: no mass")
    com = (model.body_mass[bodies, None] * data.xipos[bodies]).sum(axis=0) / mass
    tensor = np.zeros((3, 3))
    for body in bodies:
        rotation = data.ximat[body].reshape(3, 3)
        offset = data.xipos[body] - com
        tensor += rotation @ np.diag(model.body_inertia[body]) @ rotation.T
        tensor += model.body_mass[body] * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    position, rotation = frame
    moments, axes = np.linalg.eigh(rotation.T @ tensor @ rotation)
    order = np.argsort(-moments)  # MuJoCo's order
    axes = axes[:, order]
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return mass, rotation.T @ (com - position), _quat_of(axes), moments[order]


def _frame_along(rotation: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """`rotation` turned by the smallest rotation that takes its z to `axis`."""
    z = rotation[:, 2]
    cross, cosine = np.cross(z, axis), float(z @ axis)
    if cosine < -1.0 + 1e-12:  # opposite: half a turn about x
        return np.stack([rotation[:, 0], -rotation[:, 1], -z], axis=1)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    return (np.eye(3) + skew + skew @ skew / (1.0 + cosine)) @ rotation


def _quat_of(rotation: np.ndarray) -> np.ndarray:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rotation).reshape(-1))
    return quat


def _torque_limit(model: mujoco.MjModel, joint: int) -> float:
    """Largest torque of the actuators on `joint` within what the joint allows (a URDF's effort); 0 where neither says."""
    is_on_joint = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
    bounds = [_largest_torque(model, int(actuator)) for actuator in np.flatnonzero(is_on_joint)]
    given = max((bound for bound in bounds if 0.0 < bound < np.inf), default=np.inf)
    allowed = np.abs(model.jnt_actfrcrange[joint]).max() if model.jnt_actfrclimited[joint] else np.inf
    limit = min(given, allowed)
    return float(limit) if limit < np.inf else 0.0


def _largest_torque(model: mujoco.MjModel, actuator: int) -> float:
    """What an actuator gives to its joint at most; infinite where its model does not say.

    A motor's control is its force. That of a servo is an angle or a speed, and says nothing of its force.
    """
    force = control = np.inf
    if model.actuator_forcelimited[actuator]:
        force = np.abs(model.actuator_forcerange[actuator]).max()
    if model.actuator_ctrllimited[actuator] and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE:
        control = abs(model.actuator_gainprm[actuator, 0]) * np.abs(model.actuator_ctrlrange[actuator]).max()
    return abs(model.actuator_gear[actuator, 0]) * min(force, control)

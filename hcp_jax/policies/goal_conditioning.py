"""What the networks of a goal-conditioned arm policy see: observation, goal, v_h, and features that follow from v_h.

| encoding | length beyond observation (14) and goal (3) | content |
|---|---|---|
| those of `hcp_jax.hardware.arm_encodings` | as there | a constant of the robot |
| `chain_fk` | 57 | what `chain` says at the observed joint angles, as the released code feeds it: positions and axes of the joints, position and rotation of the end effector in the world; and its offset from the goal |
| `chain_fk+jacobian` | 109 | `chain_fk`, and how the joints move the end effector: the velocity of the end effector and of its z axis per rad/s of each joint, the end effector's velocity, and how fast each joint takes it towards the goal |
| `chain_fk+jacobian+dynamics` | 137 | `chain_fk+jacobian`, and what the motors are up against: for each joint the torque that holds the arm still, damping and friction loss in units of the torque limit, and the logarithm of the acceleration [rad/s^2] that the limit gives |
| `embedding` | its size | learned with the policy (HCP-I) |
| `none+end_effector` | 3 | no v_h, but the end effector's position: a control |
| `none+goal_offset` | 3 | no v_h, but the end effector's offset from the goal: a control |

Features of joints stand where `joint_slots` has the joints (`hcp_jax.hardware.joint_slots`); constants stay in their order.

The offset is asinh((end effector - goal) / 0.02 m): a network that sees metres hardly tells 1 cm from 2 cm, and the goal's
tolerance is 2 cm.
"""  # noqa: E501

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.hardware.arm_encodings import ARM_ENCODINGS, encode_arms
from hcp_jax.hardware.chain import GRAVITY
from hcp_jax.hardware.joint_slots import JointSlots
from hcp_jax.hardware.kinematics import exact_einsum, joint_poses, quat_to_matrix
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.policies.conditioning import Embedding

MOTOR_LOADS = "chain_fk+jacobian+dynamics"
POSE_FEATURES = {"chain_fk": 57, "chain_fk+jacobian": 109, MOTOR_LOADS: 137, "none+end_effector": 3, "none+goal_offset": 3}
OFFSET_SCALE = 0.02  # [m]
_DYNAMICS = ("link_mass", "link_com", "torque_limit", "damping", "frictionloss", "armature")


class GoalConditioning:
    """Builds the networks' input for the robots of one pool."""

    def __init__(
        self,
        pool: RobotPool,
        encoding: str,
        reference: RobotPool,
        observation_size: int,
        goal_size: int,
        embedding: Embedding | None = None,
        joint_slots: str = "packed",
    ):
        """Args:
        pool: the robots that `index` will name.
        encoding: one of `hcp_jax.config.arm.ARM_CONDITIONINGS`.
        reference: the training robots, whose ranges scale dynamics.
        embedding: the learned table, for `embedding`.
        joint_slots: layout of observations (`hcp_jax.hardware.joint_slots`), which features of joints follow.
        """
        self.encoding, self._embedding = encoding, embedding
        self.is_learned = embedding is not None
        is_constant = encoding in ARM_ENCODINGS
        self._table = jnp.asarray(encode_arms(pool, encoding if is_constant else "none", reference))
        self._chain_pos = jnp.asarray(pool.hardware["chain_pos"], jnp.float32)
        self._chain_rotation = quat_to_matrix(jnp.asarray(pool.hardware["chain_quat"], jnp.float32))
        self._slots = JointSlots(pool, joint_slots)
        self._joint_mask = jnp.asarray(pool.hardware["joint_mask"], jnp.float32)
        self._dynamics = {name: jnp.asarray(pool.hardware[name], jnp.float32) for name in _DYNAMICS if encoding == MOTOR_LOADS}
        v_h_size = embedding.size if embedding is not None else self._table.shape[1]
        self.size = observation_size + goal_size + v_h_size + POSE_FEATURES.get(encoding, 0)

    def init(self, key: jax.Array) -> jax.Array | None:
        """The embedding table, or None."""
        return self._embedding.init(key) if self._embedding is not None else None

    def inputs(self, embedding: jax.Array | None, index: jax.Array, obs: jax.Array, goal: jax.Array) -> jax.Array:
        """The networks' input for robots at `index` [B], obs [B, 14], goal [B, 3]: [B, size]."""
        v_h = self._table[index] if embedding is None else embedding[index]
        features = self._features(index, obs, goal)
        return jnp.concatenate([obs, goal, v_h, *features["robot"], *features["goal"]], axis=-1)

    def robot_inputs(self, index: jax.Array, obs: jax.Array) -> jax.Array:
        """What `inputs` has that no goal has a part in, the observation first: [B, ...].

        For agents that relabel goals themselves. Raises ValueError where v_h is learned.
        """
        if self.is_learned:
            raise ValueError("a learned v_h is part of the learner's params")
        features = self._features(index, obs, jnp.zeros((*index.shape, 3)))
        return jnp.concatenate([obs, self._table[index], *features["robot"]], axis=-1)

    def _features(self, index: jax.Array, obs: jax.Array, goal: jax.Array) -> dict[str, list[jax.Array]]:
        """The encoding's features [B, ...] of the robot's pose, and those of the pose and the goal."""
        if self.encoding not in POSE_FEATURES:
            return {"robot": [], "goal": []}
        angles, velocities = jnp.split(obs, 2, axis=-1)
        angles, velocities = self._slots.to_joints(angles, index), self._slots.to_joints(velocities, index)
        positions, rotations = joint_poses(self._chain_pos[index], self._chain_rotation[index], angles)
        end_effector = positions[..., -1, :]
        offset = scale_offset(end_effector - goal)
        if self.encoding == "none+end_effector":
            return {"robot": [end_effector], "goal": []}
        if self.encoding == "none+goal_offset":
            return {"robot": [], "goal": [offset]}
        mask = self._joint_mask[index][..., None]
        anchors, axes = positions[..., :-1, :] * mask, rotations[..., :-1, :, 2] * mask

        def entries(values: jax.Array) -> jax.Array:
            return self._slots.to_entries(values, index)

        robot, towards = [entries(anchors), entries(axes), end_effector, rotations[..., -1, :, :]], [offset]
        if self.encoding in ("chain_fk+jacobian", MOTOR_LOADS):
            jacobian = jnp.cross(axes, end_effector[..., None, :] - anchors)
            turns = jnp.cross(axes, rotations[..., -1, None, :, 2])
            robot += [entries(jacobian), entries(turns), exact_einsum("...ij,...i->...j", jacobian, velocities)]
            towards += [entries(exact_einsum("...ij,...j->...i", jacobian, soft_direction(goal - end_effector)))]
        if self.encoding == MOTOR_LOADS:
            dynamics = {name: values[index] for name, values in self._dynamics.items()}
            robot += [entries(load) for load in motor_loads(dynamics, anchors, axes, positions, rotations)]
        flat = (*angles.shape[:-1], -1)
        return {"robot": [part.reshape(flat) for part in robot], "goal": towards}


def motor_loads(
    dynamics: dict[str, jax.Array], anchors: jax.Array, axes: jax.Array, positions: jax.Array, rotations: jax.Array
) -> list[jax.Array]:
    """What each joint's motor has to overcome, 0 for missing joints: four arrays [..., 7].

    Args:
        dynamics: rows of a pool's hardware, link_com [..., 7, 3], the others [..., 7].
        anchors, axes: [..., 7, 3] in the world, 0 for missing joints.
        positions, rotations: [..., 8, 3], [..., 8, 3, 3] (`joint_poses`).

    Returns:
        the torque that holds the arm still, damping [s/rad] and friction loss, each over the torque limit; and the logarithm of
        the limit over the inertia about the joint's axis [1/s^2], links taken as points.
    """
    mass, limit = dynamics["link_mass"], dynamics["torque_limit"]
    is_missing = limit <= 0
    limit = jnp.where(is_missing, 1.0, limit)
    com = positions[..., :-1, :] + exact_einsum("...ij,...j->...i", rotations[..., :-1, :, :], dynamics["link_com"])
    # How fast the joint on the first axis moves the link on the second: [..., 7, 7, 3]; not those before it.
    motion = jnp.cross(axes[..., :, None, :], com[..., None, :, :] - anchors[..., :, None, :])
    motion = motion * jnp.triu(jnp.ones((mass.shape[-1], mass.shape[-1])))[..., None]
    hold = GRAVITY * exact_einsum("...ij,...j->...i", motion[..., 2], mass)
    inertia = exact_einsum("...ij,...j->...i", jnp.sum(jnp.square(motion), axis=-1), mass) + dynamics["armature"]
    agility = jnp.log(limit / jnp.where(is_missing, 1.0, inertia))
    return [jnp.where(is_missing, 0.0, hold / limit), dynamics["damping"] / limit, dynamics["frictionloss"] / limit, agility]


def split_joints(inputs: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The inputs of `chain_fk+jacobian` [..., 126] as what belongs to each joint [..., 7, 15] and the rest [..., 21]."""
    sizes = (7, 7, 3, 21, 21, 3, 9, 21, 21, 3, 3, 7)
    parts = jnp.split(inputs, np.cumsum(sizes)[:-1], axis=-1)
    angles, velocities, goal, anchors, axes, position, rotation, jacobian, turns, velocity, offset, towards = parts
    vectors = [part.reshape((*part.shape[:-1], 7, 3)) for part in (anchors, axes, jacobian, turns)]
    scalars = [part[..., None] for part in (angles, velocities, towards)]
    rest = jnp.concatenate([goal, position, rotation, velocity, offset], axis=-1)
    return jnp.concatenate([*scalars, *vectors], axis=-1), rest


def scale_offset(offset: jax.Array) -> jax.Array:
    """An offset in m, linear within `OFFSET_SCALE` and logarithmic beyond it."""
    return jnp.arcsinh(offset / OFFSET_SCALE)


def soft_direction(offset: jax.Array) -> jax.Array:
    """An offset in m, of length 1 far beyond `OFFSET_SCALE` and linear within it."""
    return offset / jnp.sqrt(jnp.sum(jnp.square(offset), axis=-1, keepdims=True) + OFFSET_SCALE**2)

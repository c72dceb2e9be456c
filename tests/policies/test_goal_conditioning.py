import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from hcp_jax.config.arm import ARM_CONDITIONINGS
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.policies.conditioning import Embedding
from hcp_jax.policies.goal_conditioning import GoalConditioning

LENGTHS = {
    "none": 0,
    "chain": 48,
    "chain_fk": 57,
    "chain_fk+jacobian": 109,
    "chain_fk+jacobian+dynamics": 137,
    "chain+dynamics": 76,
    "dynamics": 28,
    "random": 28,
    "embedding": 5,
} | {
    "none+end_effector": 3,
    "none+goal_offset": 3,
}
GOAL = jnp.array([[0.5, 0.1, 0.2], [0.4, -0.2, 0.0]])


@pytest.fixture(scope="module")
def arms() -> RobotPool:
    return make_arm_pool("reacher", ArmRanges(), ("D", "I"), 1, seed=3)


def make(arms: RobotPool, encoding: str) -> GoalConditioning:
    embedding = Embedding(arms.num_robots, 5, 0.1) if encoding == "embedding" else None
    return GoalConditioning(arms, encoding, arms, observation_size=14, goal_size=3, embedding=embedding)


def at_rest(angles: np.ndarray) -> jax.Array:
    """Observations [2, 14] of both arms."""
    return jnp.concatenate([jnp.asarray(angles, jnp.float32), jnp.zeros((2, 7))], axis=1)


def features(arms: RobotPool, encoding: str, angles: np.ndarray) -> np.ndarray:
    """What each encoding adds to the observation and the goal, for both arms: [2, size]."""
    conditioning = make(arms, encoding)
    obs = at_rest(angles)
    inputs = conditioning.inputs(conditioning.init(jax.random.key(0)), jnp.arange(2), obs, GOAL)
    np.testing.assert_array_equal(inputs[:, :17], jnp.concatenate([obs, GOAL], axis=1))
    assert inputs.shape == (2, conditioning.size)
    return np.asarray(inputs[:, 17:])


@pytest.fixture
def angles(arms, rng) -> np.ndarray:
    return rng.uniform(-1, 1, (2, 7)) * arms.hardware["joint_mask"]


def end_effectors(arms: RobotPool, angles: np.ndarray) -> np.ndarray:
    """By MuJoCo: [2, 3] m."""
    positions = []
    for row, model in enumerate(arms.models()):
        data = mujoco.MjData(model)
        data.qpos[:] = angles[row]
        mujoco.mj_kinematics(model, data)
        positions.append(data.site("ref_pt").xpos)
    return np.asarray(positions)


def test_every_encoding_is_as_long_as_documented(arms, angles):
    assert {name: features(arms, name, angles).shape[1] for name in ARM_CONDITIONINGS} == LENGTHS


@pytest.mark.parametrize("encoding", ["chain_fk", "chain_fk+jacobian+dynamics"])
def test_no_product_of_geometry_is_left_to_a_gpus_rounding(encoding, arms, angles):
    conditioning = make(arms, encoding)
    text = str(jax.make_jaxpr(lambda obs: conditioning.inputs(None, jnp.arange(2), obs, GOAL))(at_rest(angles)))
    assert text.count("dot_general[") == text.count("precision=(Precision.HIGHEST, Precision.HIGHEST)") > 7


def test_the_controls_see_the_end_effector_and_nothing_else_of_the_robot(arms, angles):
    positions = end_effectors(arms, angles)
    np.testing.assert_allclose(features(arms, "none+end_effector", angles), positions, atol=1e-5)
    offset = features(arms, "none+goal_offset", angles)
    np.testing.assert_allclose(0.02 * np.sinh(offset), positions - GOAL, atol=1e-4)


def test_chain_fk_holds_the_end_effector_its_offset_and_zeros_for_missing_joints(arms, angles):
    values = features(arms, "chain_fk", angles)
    positions = end_effectors(arms, angles)
    np.testing.assert_allclose(values[:, 42:45], positions, atol=1e-5)
    np.testing.assert_allclose(values[:, 54:], features(arms, "none+goal_offset", angles), atol=1e-5)
    np.testing.assert_array_equal(values[0, [*range(15, 21), *range(36, 42)]], 0.0)
    assert (values[1, 15:21] != 0.0).all()


@pytest.mark.parametrize("encoding", [name for name in LENGTHS if name.startswith("chain_fk")])
def test_features_of_aligned_joints_are_those_of_packed_ones_at_their_types_entries(arms, encoding, angles, rng):
    velocities = rng.normal(size=(2, 7)) * arms.hardware["joint_mask"]
    slots = np.array([[0, 1, 2, 3, 6, 4, 5], [0, 1, 2, 3, 4, 5, 6]])  # D lacks j4 and j5
    order = np.argsort(slots, axis=1)
    packed = [jnp.asarray(part, jnp.float32) for part in (angles, velocities)]
    aligned = [jnp.take_along_axis(part, order, axis=1) for part in packed]
    conditionings = [GoalConditioning(arms, encoding, arms, 14, 3, joint_slots=layout) for layout in ("packed", "aligned")]
    seen = [
        np.asarray(conditioning.inputs(None, jnp.arange(2), jnp.concatenate(obs, axis=1), GOAL))
        for conditioning, obs in zip(conditionings, (packed, aligned), strict=True)
    ]
    # Sizes of obs, goal, anchors, axes, end effector, rotation; Jacobian, turns, velocity; motor loads; offset, towards.
    sizes = [7, 7, 3, 21, 21, 3, 9]
    sizes += [21, 21, 3] if encoding != "chain_fk" else []
    sizes += [7] * 4 if encoding == "chain_fk+jacobian+dynamics" else []
    sizes += [3, 7] if encoding != "chain_fk" else [3]
    assert sum(sizes) == seen[0].shape[1]
    for before, after in zip(*(np.split(values, np.cumsum(sizes)[:-1], axis=1) for values in seen), strict=True):
        if before.shape[1] % 7 == 0:  # of joints, one or three numbers each
            before = np.take_along_axis(before.reshape(2, 7, -1), order[:, :, None], axis=1).reshape(before.shape)
        np.testing.assert_allclose(after, before, atol=1e-6)


def test_motor_loads_are_the_torques_that_mujoco_holds_the_arm_with_and_what_the_motors_make_of_the_rest(arms, angles):
    limit = np.where(arms.hardware["joint_mask"] > 0, arms.hardware["torque_limit"], 1.0)
    values = features(arms, "chain_fk+jacobian+dynamics", angles)
    plain = features(arms, "chain_fk+jacobian", angles)
    np.testing.assert_array_equal(values[:, :99], plain[:, :99])
    np.testing.assert_array_equal(values[:, 127:], plain[:, 99:])
    hold, damping, friction, agility = np.split(values[:, 99:127], 4, axis=1)
    for row, model in enumerate(arms.models()):
        data = mujoco.MjData(model)
        data.qpos[:] = angles[row]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(hold[row] * limit[row], data.qfrc_bias, atol=1e-3)
        count, inertia = int(arms.hardware["joint_mask"][row].sum()), np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        # Links as points: no more inertia than they have, and most of it.
        ratio = limit[row, :count] / np.diag(inertia)[:count] / np.exp(agility[row, :count])
        assert ((ratio > 0.3) & (ratio < 1.0 + 1e-4)).all()
        np.testing.assert_array_equal(agility[row, count:], 0.0)
    np.testing.assert_allclose(damping * limit, arms.hardware["damping"], rtol=1e-5)
    np.testing.assert_allclose(friction * limit, arms.hardware["frictionloss"], rtol=1e-5)

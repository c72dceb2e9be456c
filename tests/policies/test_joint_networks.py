import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax import presets
from hcp_jax.config import ArmPoolConfig, ConfigError, DDPGConfig
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.policies.goal_conditioning import GoalConditioning, split_joints
from hcp_jax.policies.networks import JointActor, JointCritic

SIZES = (8, 16)
GOAL = jnp.array([[0.5, 0.1, 0.2]])


def make_inputs(obs: jax.Array) -> jax.Array:
    """Of one arm with 7 joints."""
    pool = make_arm_pool("reacher", ArmRanges(), ("I",), 1, seed=3)
    conditioning = GoalConditioning(pool, "chain_fk+jacobian", pool, observation_size=14, goal_size=3)
    return conditioning.inputs(None, jnp.zeros(1, jnp.int32), obs, GOAL)


@pytest.fixture
def obs(rng) -> jax.Array:
    return jnp.asarray(rng.uniform(-1, 1, (1, 14)), jnp.float32)


def test_each_joint_gets_its_own_angle_velocity_and_motion_of_the_end_effector(obs):
    inputs = make_inputs(obs)
    joints, rest = split_joints(inputs)
    assert (joints.shape, rest.shape) == ((1, 7, 15), (1, 21))
    np.testing.assert_array_equal(joints[0, :, 0], obs[0, :7])
    np.testing.assert_array_equal(joints[0, :, 1], obs[0, 7:])
    end_effector, step = rest[0, 3:6], 1e-2
    for joint in range(7):
        moved = [split_joints(make_inputs(obs.at[0, joint].add(sign * step)))[1][0, 3:6] for sign in (1, -1)]
        np.testing.assert_allclose((moved[0] - moved[1]) / (2 * step), joints[0, joint, 9:12], atol=1e-3)
    velocity = jnp.einsum("ji,j->i", joints[0, :, 9:12], obs[0, 7:])
    np.testing.assert_allclose(rest[0, 15:18], velocity, atol=1e-5)
    direction = (GOAL[0] - end_effector) / jnp.sqrt(jnp.sum((GOAL[0] - end_effector) ** 2) + 0.02**2)
    np.testing.assert_allclose(joints[0, :, 2], joints[0, :, 9:12] @ direction, atol=1e-5)


def test_all_joints_share_their_layers(obs):
    inputs = make_inputs(obs)
    actor, critic = JointActor(SIZES), JointCritic(SIZES)
    action = actor.init_with_output(jax.random.key(0), inputs)[0]
    assert action.shape == (1, 7)
    for params in (actor.init(jax.random.key(0), inputs), critic.init(jax.random.key(0), inputs, action)):
        first = params["params"]["hidden_joint_0"]["kernel"]
        assert first.shape[0] in (15 + 7 + 21, 16 + 7 + 21), "one joint, its place and the rest"


def test_the_action_of_each_joint_changes_its_value(obs):
    inputs, critic = make_inputs(obs), JointCritic(SIZES)
    params = critic.init(jax.random.key(0), inputs, jnp.zeros((1, 7)))
    gradient = jax.grad(lambda action: critic.apply(params, inputs, action).sum())(jnp.zeros((1, 7)))
    assert (jnp.abs(gradient) > 0).all()


def test_they_need_the_encoding_that_has_joints():
    with pytest.raises(ConfigError, match="encoding='chain_fk'"):
        presets.arm("a", "reacher", "chain_fk", ddpg=DDPGConfig(network="joints"), pool=ArmPoolConfig(("I",), ()))
    with pytest.raises(ConfigError, match=r"ddpg.network='graph': expected one of flat, film, joints"):
        DDPGConfig(network="graph")

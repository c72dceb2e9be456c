import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.envs.base import PoolEnv, draw_evenly
from hcp_jax.envs.hopper import Hopper
from hcp_jax.physics.base import PhysicsState
from hcp_jax.physics.build import make_physics


@pytest.fixture(scope="module")
def env(pool) -> PoolEnv:
    return PoolEnv(Hopper(episode_length=5), pool, make_physics("native", pool, 0.002, "rk4"))


@pytest.fixture(scope="module")
def step(env):
    return jax.jit(env.step)


def physics_state(**values) -> PhysicsState:
    """One world standing, with entries of qpos or qvel replaced: `qpos2=0.3`."""
    qpos, qvel = np.array([0, 1.25, 0, 0, 0, 0], np.float32), np.zeros(6, np.float32)
    for name, value in values.items():
        (qpos if name.startswith("qpos") else qvel)[int(name[4:])] = value
    return PhysicsState(jnp.asarray(qpos)[None], jnp.asarray(qvel)[None], jnp.zeros((1, 6)))


@pytest.mark.parametrize(
    ("values", "fallen"),
    [
        ({}, False),
        ({"qpos1": 0.71}, False),
        ({"qpos1": 0.70}, True),
        ({"qpos2": 0.19}, False),
        ({"qpos2": -0.2}, True),
        ({"qvel5": 99.0}, False),
        ({"qvel5": -100.0}, True),
        ({"qpos0": 500.0}, False),
    ],
)
def test_a_hopper_has_fallen_exactly_when_the_facts_say_so(values, fallen):
    assert bool(Hopper().is_terminated(physics_state(**values))[0]) is fallen


def test_the_observation_is_position_without_x_then_clipped_velocity():
    state = physics_state(qpos0=7.0, qpos3=-0.5, qvel0=-30.0, qvel5=12.0, qvel4=2.0)
    np.testing.assert_allclose(Hopper().observe(state)[0], [1.25, 0, -0.5, 0, 0, -10, 0, 0, 0, 2, 10])


def test_the_reward_is_forward_speed_plus_one_minus_the_action_cost():
    before, after = physics_state(qpos0=1.0), physics_state(qpos0=1.016)
    reward = Hopper().reward(before, jnp.asarray([[1.0, -0.5, 0.0]]), after)
    assert float(reward[0]) == pytest.approx(0.016 / 0.008 + 1 - 1e-3 * 1.25, rel=1e-4)


def test_episodes_start_standing_with_noise_of_five_thousandths(env, key):
    state = env.reset(key, jnp.arange(64))
    offset = state.physics.qpos - jnp.asarray([0, 1.25, 0, 0, 0, 0])
    assert 0.004 < float(jnp.abs(offset).max()) <= 0.005
    assert 0.004 < float(jnp.abs(state.physics.qvel).max()) <= 0.005


def test_actions_beyond_the_range_act_and_cost_as_the_clipped_ones(env, step, key):
    state = env.reset(key, jnp.arange(8))
    one, transition = step(state, jnp.full((8, 3), 5.0))
    other, clipped = step(state, jnp.ones((8, 3)))
    np.testing.assert_array_equal(one.obs, other.obs)
    np.testing.assert_array_equal(transition.reward, clipped.reward)


def test_the_time_limit_truncates_and_does_not_terminate(env, step, key):
    state = env.reset(key, jnp.arange(8))
    for count in range(1, 6):
        state, transition = step(state, jnp.zeros((8, 3)))
        assert not transition.terminated.any()
        assert transition.truncated.tolist() == [count == 5] * 8
        assert transition.episode_length.tolist() == [count] * 8


def test_the_final_observation_is_kept_and_the_next_episode_starts_fresh_with_another_robot(env, step, key):
    index = jnp.arange(64, dtype=jnp.int32)
    state = env.reset(key, index)
    action = jnp.full((64, 3), 0.3)
    for _ in range(4):
        state, _ = step(state, action)
    ended, _ = jax.jit(env.step_without_reset)(state, action)
    state, transition = step(state, action)
    assert transition.done.all()
    np.testing.assert_allclose(transition.next_obs, ended.obs, atol=1e-6)
    np.testing.assert_array_equal(transition.index, index)
    assert np.abs(transition.next_obs - state.obs).max() > 0.01
    assert np.abs(np.asarray(state.obs)[:, 0] - 1.25).max() <= 0.005
    assert np.mean(np.asarray(state.index) != np.asarray(index)) > 0.9
    assert (state.step_count == 0).all()
    assert (state.episode_return == 0).all()


def test_two_resets_of_one_environment_draw_different_states_and_robots(env, step, key):
    state = env.reset(key, jnp.arange(64))
    starts = []
    for count in range(10):
        state, _ = step(state, jnp.zeros((64, 3)))
        if count % 5 == 4:
            starts.append((np.asarray(state.obs), np.asarray(state.index)))
    assert not np.array_equal(starts[0][0], starts[1][0])
    assert not np.array_equal(starts[0][1], starts[1][1])


def test_diverged_physics_ends_the_episode_with_finite_numbers(env, step, key):
    state = env.reset(key, jnp.arange(8))
    broken = dataclasses.replace(state.physics, qvel=state.physics.qvel.at[3, 1].set(1e12))
    state, transition = step(state.replace(physics=broken), jnp.zeros((8, 3)))
    assert transition.diverged.tolist() == [row == 3 for row in range(8)]
    assert transition.terminated.tolist() == [row == 3 for row in range(8)]
    assert float(transition.reward[3]) == 0.0
    for leaf in jax.tree.leaves((state.obs, transition.next_obs, transition.reward, transition.episode_return)):
        assert np.isfinite(leaf).all()


def test_robots_are_drawn_without_favour(key):
    drawn = draw_evenly(key, 4, 10)
    np.testing.assert_array_equal(np.sort(drawn[:4]), np.arange(4))
    np.testing.assert_array_equal(np.sort(drawn[4:8]), np.arange(4))


def test_the_robots_of_the_first_step_are_drawn_from_the_key(key):
    one, same, other = (draw_evenly(seed, 64, 20) for seed in (key, key, jax.random.key(9)))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)

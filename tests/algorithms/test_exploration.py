import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
from goal_probes import PlaneEnv

from hcp_jax.algorithms.exploration import Explorer, update_failure
from hcp_jax.config import DDPGConfig


def make(num_robots: int = 1, **changes) -> Explorer:
    """Explores with a policy that does nothing."""

    def stand_still(learned, index, obs, goal):
        return jnp.zeros((index.shape[0], 2))

    return Explorer(PlaneEnv((0.0,) * num_robots), stand_still, dataclasses.replace(DDPGConfig(), **changes), num_envs=10)


@functools.partial(jax.jit, static_argnums=0)
def play(explorer: Explorer, is_warm: bool, key: jax.Array) -> jax.Array:
    """The actions of one episode in each world."""
    return explorer.play(None, jnp.ones(1), jnp.asarray(is_warm), key).episodes.action


def test_robots_that_fail_are_drawn_more_often_as_far_as_asked():
    explorer = make(20, failing_share=0.5)
    failure = jnp.where(jnp.arange(20) == 3, 1.0, 0.0)
    drawn = jnp.stack([explorer.draw_robots(failure, key) for key in jax.random.split(jax.random.key(1), 100)])
    assert 0.4 < float((drawn == 3).mean()) < 0.6


def test_a_robots_failures_move_towards_its_episodes_and_to_their_mean_if_they_are_many():
    failure = update_failure(
        jnp.asarray([1.0, 1.0, 0.5]), jnp.asarray([0, 0] + [1] * 20), jnp.asarray([0.0, 1.0] + [0.0, 1.0] * 10)
    )
    np.testing.assert_allclose(failure, [0.8, 0.5, 0.5], atol=1e-6)


class StumblingEnv(PlaneEnv):
    """The physics of the second step is not plausible; the point moves on."""

    def step(self, state, action):
        following, transition = super().step(state, action)
        return following, transition.replace(diverged=state.physics == 1)


def test_an_episode_that_reaches_its_goal_after_it_diverged_has_failed(key):
    def go_there(learned, index, obs, goal):
        return goal - obs

    config = DDPGConfig(exploration_noise=0.0, random_action_probability=0.0)
    for env, share in ((PlaneEnv((0.0,), episode_length=20), 1.0), (StumblingEnv((0.0,), episode_length=20), 0.0)):
        played = Explorer(env, go_there, config, num_envs=10).play(None, jnp.ones(1), jnp.asarray(True), key)
        assert float(played.sums["successes"]) == 10 * share
        np.testing.assert_allclose(played.failure, 1.0 - share, atol=1e-6)


def test_noise_is_correlated_from_step_to_step_as_asked():
    for correlation in (0.0, 0.8):
        explorer = make(exploration_correlation=correlation, random_action_probability=0.0, exploration_noise=0.1)
        keys = jax.random.split(jax.random.key(1), 40)
        actions = np.concatenate([play(explorer, True, key) for key in keys])
        assert abs(actions.std() - 0.1) < 0.01
        assert abs(np.corrcoef(actions[:, :-1].ravel(), actions[:, 1:].ravel())[0, 1] - correlation) < 0.05


def test_all_actions_are_uniform_before_the_policy_is_warm(key):
    explorer = make(exploration_noise=0.0, random_action_probability=0.0)
    cold, warm = (play(explorer, is_warm, key) for is_warm in (False, True))
    assert abs(float(cold.std()) - 1 / np.sqrt(3)) < 0.1
    np.testing.assert_array_equal(warm, 0.0)

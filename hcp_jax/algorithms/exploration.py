"""Exploring episodes of DDPG: which robots play, with how much noise, and what of an episode may be learned from."""

import math
from collections.abc import Callable
from typing import Any, Protocol

import jax
import jax.numpy as jnp
from flax import struct

from hcp_jax.algorithms.replay import EpisodeBatch
from hcp_jax.config import DDPGConfig
from hcp_jax.devices import split_rows
from hcp_jax.envs.base import draw_evenly
from hcp_jax.envs.goal import GoalState, GoalTransition

# (what was learned, index [B], obs [B, O], goal [B, G]) -> action [B, A]
ExploredPolicyFn = Callable[[Any, jax.Array, jax.Array, jax.Array], jax.Array]
FAILURE_STEP = 0.2  # of a robot's running mean of failures, per episode


class ExploredEnv(Protocol):
    """What exploring needs of an environment (`hcp_jax.envs.goal.GoalEnv`)."""

    action_size: int
    num_robots: int
    episode_length: int

    def reset(self, key: jax.Array, index: jax.Array) -> GoalState: ...
    def step(self, state: GoalState, action: jax.Array) -> tuple[GoalState, GoalTransition]: ...


@struct.dataclass
class Exploration:
    """B episodes played. episodes: to learn from; failure: [N] the robots' running mean of failures after them; diverged: [B]
    bool; overflow: [] int32; sums: of metrics over the episodes."""

    episodes: EpisodeBatch
    failure: jax.Array
    diverged: jax.Array
    overflow: jax.Array
    sums: dict[str, jax.Array]


class Explorer:
    """Plays `num_envs` episodes at once, in lockstep, with a policy and noise."""

    def __init__(self, env: ExploredEnv, policy: ExploredPolicyFn, config: DDPGConfig, num_envs: int):
        self.env, self.config, self.num_envs = env, config, num_envs
        self._policy = policy

    def play(self, learned: Any, failure: jax.Array, is_warm: jax.Array, key: jax.Array) -> Exploration:
        """Plays an episode in each world.

        Args:
            learned: what the policy acts by.
            failure: [N] running mean of each robot's failures.
            is_warm: [] bool, False while all actions are random.
            key: of robots, goals and noise.
        """
        key_robots, key_reset, key_noise, key_steps = jax.random.split(key, 4)
        first = split_rows(self.env.reset(key_reset, self.draw_robots(failure, key_robots)))
        correlation = self.config.exploration_correlation

        def step(carry: tuple[GoalState, jax.Array], key: jax.Array):
            env_state, noise = carry
            key_noise, key_action = jax.random.split(key)
            fresh = jax.random.normal(key_noise, noise.shape)
            noise = correlation * noise + math.sqrt(1.0 - correlation**2) * fresh
            mean = self._policy(learned, env_state.index, env_state.obs, env_state.desired_goal)
            action = self._disturb(mean, noise, is_warm, key_action)
            next_state, transition = self.env.step(env_state, action)
            return (split_rows(next_state), noise), (env_state.obs, env_state.achieved_goal, transition)

        first_noise = jax.random.normal(key_noise, (self.num_envs, self.env.action_size))
        keys = jax.random.split(key_steps, self.env.episode_length)
        (last, _), (obs, achieved_goal, transitions) = jax.lax.scan(step, (first, first_noise), keys)
        ended = jnp.cumsum(transitions.diverged, axis=0) > 0
        is_over = ended
        if self.config.stop_at_success:  # after the step that succeeds
            is_over = ended | (jnp.cumsum(transitions.success, axis=0) - transitions.success > 0)
        episodes = EpisodeBatch(
            obs=jnp.swapaxes(jnp.concatenate([obs, last.obs[None]]), 0, 1),
            achieved_goal=jnp.swapaxes(jnp.concatenate([achieved_goal, last.achieved_goal[None]]), 0, 1),
            action=jnp.swapaxes(transitions.action, 0, 1),
            desired_goal=first.desired_goal,
            index=first.index,
            length=jnp.sum(~is_over, axis=0, dtype=jnp.int32),
        )
        succeeded = jnp.any(transitions.success & ~ended, axis=0).astype(jnp.float32)
        return Exploration(
            episodes=episodes,
            failure=update_failure(failure, first.index, 1.0 - succeeded),
            diverged=ended[-1],
            overflow=jnp.sum(transitions.overflow),
            sums={
                "episodes": jnp.float32(self.num_envs),
                "successes": jnp.sum(succeeded),
                "final_distance": jnp.sum(transitions.distance[-1]),
            },
        )

    def draw_robots(self, failure: jax.Array, key: jax.Array) -> jax.Array:
        """Robots for the next episodes: evenly, but for the share of those that fail. [B] int32."""
        key_even, key_failing, key_choice = jax.random.split(key, 3)
        even = draw_evenly(key_even, self.env.num_robots, self.num_envs)
        if not self.config.failing_share:
            return even
        failing = jax.random.categorical(key_failing, jnp.log(failure + 1e-3), shape=even.shape).astype(jnp.int32)
        return jnp.where(jax.random.uniform(key_choice, even.shape) < self.config.failing_share, failing, even)

    def _disturb(self, mean: jax.Array, noise: jax.Array, is_warm: jax.Array, key: jax.Array) -> jax.Array:
        """The policy's action with standard Gaussian `noise` scaled, or a uniform one: always while the buffer warms up."""
        key_uniform, key_choice = jax.random.split(key)
        noisy = mean + self.config.exploration_noise * noise
        uniform = jax.random.uniform(key_uniform, mean.shape, minval=-1.0, maxval=1.0)
        share = jnp.where(is_warm, self.config.random_action_probability, 1.0)
        is_random = jax.random.uniform(key_choice, (mean.shape[0], 1)) < share
        return jnp.clip(jnp.where(is_random, uniform, noisy), -1.0, 1.0)


def update_failure(failure: jax.Array, index: jax.Array, failed: jax.Array) -> jax.Array:
    """Moves each robot's running mean [N] towards the outcomes [B], 1 for a failure, of the episodes of robots `index` [B].

    A robot with more than 1 / `FAILURE_STEP` of them takes their mean: with a whole step for each it would overshoot.
    """
    count = jnp.zeros_like(failure).at[index].add(1.0)[index]
    step = jnp.minimum(FAILURE_STEP, 1.0 / count)
    return jnp.clip(failure.at[index].add(step * (failed - failure[index])), 0.0, 1.0)

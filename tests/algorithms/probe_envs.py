"""Environments with one idea each, whose optimal values and actions are known (as in the probe environments of rejax)."""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from hcp_jax.envs.base import EnvState, Transition


class ProbeEnv:
    """Episodes of `length` steps of two robots. obs = (1, step number); `reward(index, step, first_action, action)` [B]."""

    observation_size = 2
    action_size = 1
    num_robots = 2

    def __init__(self, length: int, reward: Callable[..., jax.Array], truncates: bool = False):
        self._length, self._reward, self._truncates = length, reward, truncates

    def reset(self, key: jax.Array, index: jax.Array) -> EnvState:
        step = jnp.zeros(index.shape, jnp.int32)
        return EnvState(
            physics=jnp.zeros(index.shape),
            index=index,
            obs=self._observe(step),
            step_count=step,
            episode_return=jnp.zeros(index.shape),
            key=jnp.copy(key),
        )

    def step(self, state: EnvState, action: jax.Array) -> tuple[EnvState, Transition]:
        action = jnp.clip(action[:, 0], -1, 1)
        first_action = jnp.where(state.step_count == 0, action, state.physics)
        reward = self._reward(state.index, state.step_count, first_action, action)
        step_count = state.step_count + 1
        done = step_count >= self._length
        no = jnp.zeros_like(done)
        episode_return = state.episode_return + reward
        transition = Transition(
            obs=state.obs,
            action=action[:, None],
            reward=reward,
            next_obs=self._observe(step_count),
            terminated=no if self._truncates else done,
            truncated=done if self._truncates else no,
            index=state.index,
            episode_return=episode_return,
            episode_length=step_count,
            diverged=no,
            overflow=jnp.int32(0),
        )
        next_step = jnp.where(done, 0, step_count)
        return (
            state.replace(
                physics=first_action,
                obs=self._observe(next_step),
                step_count=next_step,
                episode_return=jnp.where(done, 0.0, episode_return),
                index=jnp.where(done, 1 - state.index, state.index),
                key=jax.random.split(state.key, 1)[0],
            ),
            transition,
        )

    def _observe(self, step: jax.Array) -> jax.Array:
        return jnp.stack([jnp.ones(step.shape), step.astype(jnp.float32)], axis=-1)

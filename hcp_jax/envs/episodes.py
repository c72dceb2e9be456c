"""Deterministic evaluation episodes, one per robot, in one jitted call."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from hcp_jax.envs.base import PoolEnv
from hcp_jax.physics.base import PhysicsOverflowError

# (obs [B, O], v_h [B, K]) -> action [B, A], of given policy parameters.
PolicyFn = Callable[..., jax.Array]


@struct.dataclass
class Episodes:
    """One episode of each robot. index, episode_return, episode_length, diverged: [B]; overflow: []."""

    index: jax.Array
    episode_return: jax.Array
    episode_length: jax.Array
    diverged: jax.Array
    overflow: jax.Array

    def take(self, rows: slice | np.ndarray) -> "Episodes":
        """The episodes at `rows`."""
        return Episodes(
            self.index[rows], self.episode_return[rows], self.episode_length[rows], self.diverged[rows], self.overflow
        )


class Evaluator:
    """Plays whole episodes of chosen robots of a pool with the policy's mean action."""

    def __init__(self, env: PoolEnv, policy: PolicyFn):
        """Args:
        env: the environment of the evaluated robots.
        policy: `policy(params, obs, v_h) -> action`.
        """
        self.env, self._policy = env, policy
        self._play = jax.jit(self._play_episodes)

    def __call__(self, params, v_h: jax.Array, index: np.ndarray, key: jax.Array) -> Episodes:
        """Plays one episode of the robots at positions `index` [B] with hardware vectors v_h [B, K].

        Raises:
            PhysicsOverflowError: the physics dropped contacts or constraints.
        """
        episodes = jax.device_get(self._play(params, v_h, jnp.asarray(index, jnp.int32), key))
        if episodes.overflow:
            raise PhysicsOverflowError(int(episodes.overflow))
        return episodes

    def _play_episodes(self, params, v_h, index, key) -> Episodes:
        state = self.env.reset(key, index)
        episodes = Episodes(
            index=index,
            episode_return=jnp.zeros(index.shape),
            episode_length=jnp.zeros(index.shape, jnp.int32),
            diverged=jnp.zeros(index.shape, bool),
            overflow=jnp.int32(0),
        )

        def step(carry):
            state, alive, episodes = carry
            state, transition = self.env.step_without_reset(state, self._policy(params, state.obs, v_h))
            episodes = episodes.replace(
                episode_return=jnp.where(alive, transition.episode_return, episodes.episode_return),
                episode_length=jnp.where(alive, transition.episode_length, episodes.episode_length),
                diverged=episodes.diverged | (alive & transition.diverged),
                overflow=episodes.overflow + transition.overflow,
            )
            return state, alive & ~transition.done, episodes

        carry = (state, jnp.ones(index.shape, bool), episodes)
        return jax.lax.while_loop(lambda carry: jnp.any(carry[1]), step, carry)[2]

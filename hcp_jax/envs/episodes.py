"""Deterministic evaluation episodes, one per robot, in one jitted call."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from hcp_jax.devices import gather
from hcp_jax.envs.base import PoolEnv
from hcp_jax.errors import PhysicsOverflowError
from hcp_jax.physics.base import PhysicsState

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
        self._play, self._start, self._step = map(jax.jit, (self._play_episodes, self._start_episodes, self._play_step))

    def __call__(self, params, v_h: jax.Array, index: np.ndarray, key: jax.Array) -> Episodes:
        """Plays one episode of the robots at positions `index` [B] with hardware vectors v_h [B, K].

        Raises:
            PhysicsOverflowError: the physics dropped contacts or constraints.
        """
        return without_overflow(self._play(params, v_h, jnp.asarray(index, jnp.int32), key))

    def record(self, params, v_h: jax.Array, index: np.ndarray, key: jax.Array) -> tuple[Episodes, PhysicsState]:
        """The same episodes, and the states that they go through: [T + 1, B, ...], of a robot until its episode's end."""
        carry = self._start(jnp.asarray(index, jnp.int32), key)
        states = [carry[0].physics]
        while np.any(carry[1]):
            carry = self._step(params, v_h, carry)
            states.append(carry[0].physics)
        return without_overflow(carry[2]), stack_states(states)

    def _play_episodes(self, params, v_h, index, key) -> Episodes:
        carry = self._start_episodes(index, key)
        return jax.lax.while_loop(lambda carry: jnp.any(carry[1]), lambda carry: self._play_step(params, v_h, carry), carry)[2]

    def _start_episodes(self, index, key):
        """State of the worlds, whether each episode goes on [B], and the episodes so far."""
        state = self.env.reset(key, index)
        episodes = Episodes(
            index=index,
            episode_return=jnp.zeros(index.shape),
            episode_length=jnp.zeros(index.shape, jnp.int32),
            diverged=jnp.zeros(index.shape, bool),
            overflow=jnp.int32(0),
        )
        return state, jnp.ones(index.shape, bool), episodes

    def _play_step(self, params, v_h, carry):
        state, alive, episodes = carry
        state, transition = self.env.step_without_reset(state, self._policy(params, state.obs, v_h))
        episodes = episodes.replace(
            episode_return=jnp.where(alive, transition.episode_return, episodes.episode_return),
            episode_length=jnp.where(alive, transition.episode_length, episodes.episode_length),
            diverged=episodes.diverged | (alive & transition.diverged),
            overflow=episodes.overflow + transition.overflow,
        )
        return state, alive & ~transition.done, episodes


def without_overflow(episodes):
    """The episodes on the host. Raises PhysicsOverflowError if the physics dropped contacts or constraints."""
    episodes = jax.device_get(gather(episodes))
    if episodes.overflow:
        raise PhysicsOverflowError(int(episodes.overflow))
    return episodes


def stack_states(states: list[PhysicsState]) -> PhysicsState:
    """T states of B worlds as one on the host: [T, B, ...]."""
    return jax.tree.map(lambda *leaves: np.stack(leaves), *jax.device_get(states))

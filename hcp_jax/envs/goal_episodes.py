"""Deterministic evaluation episodes of goal-conditioned tasks, which end at success, in one jitted call."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from hcp_jax.envs.episodes import stack_states, without_overflow
from hcp_jax.envs.goal import GoalEnv, GoalState, GoalTransition
from hcp_jax.physics.base import PhysicsState

# (params, index [B], obs [B, O], goal [B, G]) -> action [B, A]
GoalPolicyFn = Callable[..., jax.Array]


@struct.dataclass
class GoalEpisodes:
    """One episode of each robot. index, success, final_distance [m], episode_length, diverged: [B]; desired_goal: [B, G];
    overflow: []."""

    index: jax.Array
    desired_goal: jax.Array
    success: jax.Array
    final_distance: jax.Array
    episode_length: jax.Array
    diverged: jax.Array
    overflow: jax.Array

    def take(self, rows: slice | np.ndarray) -> "GoalEpisodes":
        """The episodes at `rows`."""
        per_robot = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__ if name != "overflow"}
        return self.replace(**per_robot)


class GoalEvaluator:
    """Plays episodes of chosen robots of a pool with the policy's action."""

    def __init__(self, env: GoalEnv, policy: GoalPolicyFn):
        self.env, self._policy = env, policy
        self._play, self._start, self._step = map(jax.jit, (self._play_episodes, self._start_episodes, self._play_step))

    def __call__(self, params, index: np.ndarray, key: jax.Array) -> GoalEpisodes:
        """Plays one episode of the robots at positions `index` [B].

        Raises:
            PhysicsOverflowError: the physics dropped contacts or constraints.
        """
        return without_overflow(self._play(params, jnp.asarray(index, jnp.int32), key))

    def record(self, params, index: np.ndarray, key: jax.Array) -> tuple[GoalEpisodes, PhysicsState]:
        """The same episodes, and the states that they go through: [T + 1, B, ...], of a robot until its episode's end."""
        carry = self._start(jnp.asarray(index, jnp.int32), key)
        states = [carry[0].physics]
        while self._is_going_on(carry):
            carry = self._step(params, carry)
            states.append(carry[0].physics)
        return without_overflow(carry[1]), stack_states(states)

    def step(self, params, state: GoalState) -> tuple[GoalState, GoalTransition]:
        """One control step of every world under the policy."""
        return self.env.step(state, self._policy(params, state.index, state.obs, state.desired_goal))

    def _play_episodes(self, params, index, key) -> GoalEpisodes:
        carry = self._start_episodes(index, key)
        return jax.lax.while_loop(self._is_going_on, lambda carry: self._play_step(params, carry), carry)[1]

    def _start_episodes(self, index, key):
        """State of the worlds, the episodes so far, and the number of steps."""
        state = self.env.reset(key, index)
        episodes = GoalEpisodes(
            index=index,
            desired_goal=state.desired_goal,
            success=jnp.zeros(index.shape, bool),
            final_distance=jnp.full(index.shape, jnp.inf),
            episode_length=jnp.zeros(index.shape, jnp.int32),
            diverged=jnp.zeros(index.shape, bool),
            overflow=jnp.int32(0),
        )
        return state, episodes, jnp.int32(0)

    def _is_going_on(self, carry):
        _, episodes, step = carry
        return (step < self.env.episode_length) & ~jnp.all(episodes.success | episodes.diverged)

    def _play_step(self, params, carry):
        state, episodes, step = carry
        alive = ~(episodes.success | episodes.diverged)
        state, transition = self.step(params, state)
        episodes = episodes.replace(
            success=episodes.success | (alive & transition.success & ~transition.diverged),
            final_distance=jnp.where(alive, transition.distance, episodes.final_distance),
            episode_length=episodes.episode_length + alive,
            diverged=episodes.diverged | (alive & transition.diverged),
            overflow=episodes.overflow + transition.overflow,
        )
        return state, episodes, step + 1

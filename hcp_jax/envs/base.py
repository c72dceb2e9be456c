"""Vectorised episodes over a robot pool: one task, one physics engine, B worlds.

The contract, each sentence a test:
- `terminated` and `truncated` are apart; an episode that ends by the time limit alone is truncated.
- `Transition.next_obs` is the observation that the step led to, also where the episode ended; `EnvState.obs` is already
  the next episode's first one.
- An ended episode restarts with a fresh key and a robot drawn uniformly from the pool.
- A world whose physics is not plausible is terminated with reward 0 and its last plausible observation.
"""

from typing import Protocol

import chex
import jax
import jax.numpy as jnp
from flax import struct

from hcp_jax.hardware.pool import RobotPool
from hcp_jax.physics.base import Physics, PhysicsState, is_plausible, select_rows


@struct.dataclass
class EnvState:
    """State of B worlds: physics; index: [B] int32 position in the pool; obs: [B, O]; step_count: [B]; episode_return: [B]."""

    physics: PhysicsState
    index: jax.Array
    obs: jax.Array
    step_count: jax.Array
    episode_return: jax.Array
    key: jax.Array


@struct.dataclass
class Transition:
    """One control step of B worlds.

    obs, next_obs: [B, O]; action: [B, A]; reward: [B]; terminated, truncated, diverged: [B] bool; index: [B] int32, the robot
    that acted; episode_return, episode_length: [B], including this step; overflow: [] int32.
    """

    obs: jax.Array
    action: jax.Array
    reward: jax.Array
    next_obs: jax.Array
    terminated: jax.Array
    truncated: jax.Array
    index: jax.Array
    episode_return: jax.Array
    episode_length: jax.Array
    diverged: jax.Array
    overflow: jax.Array

    @property
    def done(self) -> jax.Array:
        return self.terminated | self.truncated


class Task(Protocol):
    """What the robots are asked to do. Arrays have a leading world axis B."""

    @property
    def observation_size(self) -> int: ...
    @property
    def action_size(self) -> int: ...
    @property
    def sim_dt(self) -> float: ...
    @property
    def num_substeps(self) -> int: ...
    @property
    def episode_length(self) -> int: ...
    def sample_initial(self, robots: RobotPool, key: jax.Array) -> PhysicsState: ...
    def observe(self, physics: PhysicsState) -> jax.Array: ...
    def reward(self, before: PhysicsState, action: jax.Array, after: PhysicsState) -> jax.Array: ...
    def is_terminated(self, physics: PhysicsState) -> jax.Array: ...


def draw_evenly(key: jax.Array, num_robots: int, num_envs: int) -> jax.Array:
    """Robots for `num_envs` episodes, whole permutations of the pool: none twice before each was drawn once. [B] int32."""
    keys = jax.random.split(key, -(-num_envs // num_robots))
    rows = jax.vmap(lambda key: jax.random.permutation(key, num_robots))(keys)
    return rows.reshape(-1)[:num_envs].astype(jnp.int32)


class PoolEnv:
    """The environment of one task over one pool. Stateless: everything that changes is in `EnvState`."""

    def __init__(self, task: Task, pool: RobotPool, physics: Physics):
        self.task, self.pool, self.physics = task, pool, physics
        self.observation_size, self.action_size = task.observation_size, task.action_size
        self.num_robots = pool.num_robots
        self.episode_length = task.episode_length

    def reset(self, key: jax.Array, index: jax.Array) -> EnvState:
        """Starts an episode of the robots at positions `index` [B]."""
        key, key_initial = jax.random.split(key)
        physics = self.task.sample_initial(self.pool.take(index), key_initial)
        num_envs = index.shape[0]
        return EnvState(
            physics=physics,
            index=index,
            obs=self.task.observe(physics),
            step_count=jnp.zeros(num_envs, jnp.int32),
            episode_return=jnp.zeros(num_envs),
            key=key,
        )

    def step(self, state: EnvState, action: jax.Array) -> tuple[EnvState, Transition]:
        """One control step of every world; ended episodes restart with another robot."""
        state, transition = self.step_without_reset(state, action)
        key, key_robot, key_reset = jax.random.split(state.key, 3)
        fresh_index = jax.random.randint(key_robot, state.index.shape, 0, self.num_robots, jnp.int32)
        return self.restart(state, transition.done, key_reset, fresh_index).replace(key=key), transition

    def restart(self, state: EnvState, done: jax.Array, key: jax.Array, index: jax.Array) -> EnvState:
        """Worlds where `done` [B] is set start an episode of robots `index` [B]; the others go on."""
        fresh = self.reset(key, index)
        return state.replace(
            physics=select_rows(done, fresh.physics, state.physics),
            index=jnp.where(done, fresh.index, state.index),
            obs=jnp.where(done[:, None], fresh.obs, state.obs),
            step_count=jnp.where(done, 0, state.step_count),
            episode_return=jnp.where(done, 0.0, state.episode_return),
        )

    def step_without_reset(self, state: EnvState, action: jax.Array) -> tuple[EnvState, Transition]:
        """One control step that leaves ended episodes where they ended. Actions are clipped to [-1, 1]."""
        chex.assert_shape(action, (state.index.shape[0], self.action_size))
        action = jnp.clip(action, -1.0, 1.0)
        after, overflow = self.physics.step(self.pool.take(state.index), state.physics, action, self.task.num_substeps)
        plausible = is_plausible(after)
        after = select_rows(plausible, after, state.physics)
        reward = jnp.where(plausible, self.task.reward(state.physics, action, after), 0.0)
        step_count = state.step_count + 1
        terminated = ~plausible | self.task.is_terminated(after)
        next_state = state.replace(
            physics=after,
            obs=self.task.observe(after),
            step_count=step_count,
            episode_return=state.episode_return + reward,
        )
        transition = Transition(
            obs=state.obs,
            action=action,
            reward=reward,
            next_obs=next_state.obs,
            terminated=terminated,
            truncated=~terminated & (step_count >= self.episode_length),
            index=state.index,
            episode_return=next_state.episode_return,
            episode_length=step_count,
            diverged=~plausible,
            overflow=overflow,
        )
        return next_state, transition

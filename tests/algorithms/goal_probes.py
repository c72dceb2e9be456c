"""A goal-conditioned environment of one idea: a point on a plane is moved by its action, turned as its robot turns it."""

import jax
import jax.numpy as jnp

from hcp_jax.envs.goal import GoalState, GoalTransition

REACH = 0.15


class PlaneEnv:
    """Robot i moves by 0.25 * action turned by turns[i] [rad]; goals lie on the circle of radius 1, success is within `REACH`.

    With `same_goal`, it is (1, 0) in every episode. With `diverging`, robot 0's physics fails after its second step.
    """

    observation_size = goal_size = action_size = 2

    def __init__(self, turns: tuple[float, ...], episode_length: int = 10, diverging: bool = False, same_goal: bool = False):
        cosine, sine = jnp.cos(jnp.asarray(turns)), jnp.sin(jnp.asarray(turns))
        self._rotations = jnp.stack([jnp.stack([cosine, -sine], -1), jnp.stack([sine, cosine], -1)], -2)
        self.num_robots, self.episode_length, self.diverging = len(turns), episode_length, diverging
        self.max_angle = 0.0 if same_goal else 2 * jnp.pi

    def reset(self, key: jax.Array, index: jax.Array) -> GoalState:
        key, key_goal = jax.random.split(key)
        position = jnp.zeros((index.shape[0], 2))
        angle = jax.random.uniform(key_goal, index.shape, maxval=self.max_angle)
        goal = jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
        return GoalState(jnp.zeros(index.shape, jnp.int32), index, position, position, goal, key)

    def step(self, state: GoalState, action: jax.Array) -> tuple[GoalState, GoalTransition]:
        action = jnp.clip(action, -1.0, 1.0)
        diverged = self.diverging & (state.physics >= 2) & (state.index == 0)
        moved = state.obs + 0.25 * jnp.einsum("bij,bj->bi", self._rotations[state.index], action)
        position = jnp.where(diverged[:, None], state.obs, moved)
        reward, success = self.compute_reward(position, state.desired_goal, action)
        distance = jnp.linalg.norm(position - state.desired_goal, axis=-1)
        state = state.replace(physics=state.physics + 1, obs=position, achieved_goal=position)
        return state, GoalTransition(action, reward, success, distance, diverged, jnp.int32(0))

    def action_mask(self, index):
        return jnp.ones((*index.shape, 2))

    def compute_reward(self, achieved_goal, desired_goal, action):
        success = jnp.linalg.norm(achieved_goal - desired_goal, axis=-1) < REACH
        return jnp.where(success, 1.0, -1.0) - 0.05 * jnp.sum(jnp.square(action), axis=-1), success


class PlaneInputs:
    """Observation, goal and, with an embedding, a learned v_h of width 2."""

    def __init__(self, num_robots: int, learned: bool):
        self._num_robots, self._learned = num_robots, learned
        self.size = 4 + 2 * learned

    def init(self, key: jax.Array) -> jax.Array | None:
        return jax.random.normal(key, (self._num_robots, 2)) if self._learned else None

    def inputs(self, embedding, index, obs, goal):
        return jnp.concatenate([obs, goal] if embedding is None else [obs, goal, embedding[index]], axis=-1)

"""Gymnasium's interfaces to our environments, for agents that are not ours.

Worlds that end restart in the same step (`AutoresetMode.SAME_STEP`): the observation is the next episode's first, the ended
one's last is `info["final_obs"]`. `info["robot_id"]` is the robot of each world.
"""

from collections.abc import Callable
from typing import Any, ClassVar, Generic, TypeVar

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from hcp_jax.envs.base import PoolEnv, draw_evenly
from hcp_jax.envs.goal import GoalEnv, GoalState
from hcp_jax.physics.base import select_rows

# (index [B], obs [B, O]) -> what an agent sees of the robots and their state [B, K], the observation first.
RobotInputs = Callable[[jax.Array, jax.Array], jax.Array]
Env = TypeVar("Env", bound=PoolEnv | GoalEnv)


def unbounded(size: int) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)


class _VectorEnv(gymnasium.vector.VectorEnv, Generic[Env]):
    """What both kinds of worlds share: spaces, seeds, and dressing steps as Gymnasium wants them."""

    metadata: ClassVar[dict[str, Any]] = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": []}

    def __init__(self, env: Env, num_envs: int, robot_inputs: RobotInputs):
        """Args:
        env: the environment of a pool.
        num_envs: worlds, each with its own robot.
        robot_inputs: builds what the agent sees of robot and state.
        """
        self.env, self.num_envs, self._robot_inputs = env, num_envs, robot_inputs
        size = jax.eval_shape(robot_inputs, jnp.zeros(1, jnp.int32), jnp.zeros((1, env.observation_size))).shape[1]
        self.single_observation_space = self._make_observation_space(size)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (env.action_size,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._robot_ids = np.asarray(env.pool.robot_id)
        self._reset, self._step = jax.jit(self._reset_worlds), jax.jit(self._step_worlds)
        self._state: Any = None

    def _make_observation_space(self, size: int) -> gymnasium.Space:
        raise NotImplementedError

    def _reset_worlds(self, key: jax.Array) -> tuple[Any, Any]:
        """The worlds' state and what the agent sees of it."""
        raise NotImplementedError

    def _step_worlds(self, state: Any, action: jax.Array) -> tuple[Any, dict[str, Any]]:
        """The next state, and `obs`, `reward`, `terminated`, `truncated`, `final_obs` and arrays [B] for `info`."""
        raise NotImplementedError

    def reset(self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None):
        """Starts all worlds. Of a list of seeds, one per world, the first counts: the worlds are drawn together."""
        super().reset(seed=seed[0] if isinstance(seed, list) else seed, options=options)
        self._state, obs = self._reset(jax.random.key(int(self.np_random.integers(2**31))))
        return jax.tree.map(np.asarray, obs), {"robot_id": self._robot_ids[np.asarray(self._state.index)]}

    def step(self, actions: np.ndarray):
        """One control step of every world.

        Raises:
            gymnasium.error.ResetNeeded: the worlds were never reset.
        """
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset before the first step")
        acted = self._robot_ids[np.asarray(self._state.index)]
        self._state, result = self._step(self._state, jnp.asarray(actions, jnp.float32))
        result = jax.tree.map(np.asarray, result)
        obs, reward, terminated, truncated, final_obs = (
            result.pop(name) for name in ("obs", "reward", "terminated", "truncated", "final_obs")
        )
        infos: dict[str, Any] = {"robot_id": self._robot_ids[np.asarray(self._state.index)], **result}
        done = terminated | truncated
        if done.any():
            infos["final_obs"] = np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(done):
                infos["final_obs"][row] = jax.tree.map(lambda leaf, row=row: leaf[row], final_obs)
            infos["final_info"] = {"robot_id": acted, **result}
            infos["_final_obs"] = infos["_final_info"] = done
        return obs, reward.astype(np.float64), terminated, truncated, infos


class PoolVectorEnv(_VectorEnv[PoolEnv]):
    """A pool's worlds (`PoolEnv`): a robot drawn anew for each episode, its v_h in the observation."""

    def _make_observation_space(self, size: int) -> gymnasium.Space:
        return unbounded(size)

    def _reset_worlds(self, key):
        key_robots, key_reset = jax.random.split(key)
        state = self.env.reset(key_reset, draw_evenly(key_robots, self.env.num_robots, self.num_envs))
        return state, self._robot_inputs(state.index, state.obs)

    def _step_worlds(self, state, action):
        acted = state.index
        state, transition = self.env.step(state, action)
        return state, {
            "obs": self._robot_inputs(state.index, state.obs),
            "reward": transition.reward,
            "terminated": transition.terminated,
            "truncated": transition.truncated,
            "final_obs": self._robot_inputs(acted, transition.next_obs),
        }


@struct.dataclass
class GoalWorlds:
    """State of B worlds of a goal task: goal, the environment's; step_count: [B] int32 of each episode."""

    goal: GoalState
    step_count: jax.Array

    @property
    def index(self) -> jax.Array:
        return self.goal.index


class GoalVectorEnv(_VectorEnv[GoalEnv]):
    """A goal task's worlds (`GoalEnv`), observed as Gymnasium-Robotics does: `observation`, `achieved_goal`, `desired_goal`.

    Episodes end at success or diverged physics (terminated) or after their length (truncated); each restarts by itself.
    `info` has `is_success` and the executed `action` [B, A], which `compute_reward` needs.
    """

    def _make_observation_space(self, size: int) -> gymnasium.Space:
        goal = unbounded(self.env.goal_size)
        return gymnasium.spaces.Dict({"observation": unbounded(size), "achieved_goal": goal, "desired_goal": goal})

    def _draw(self, key: jax.Array) -> GoalState:
        key_robots, key_reset = jax.random.split(key)
        index = jax.random.randint(key_robots, (self.num_envs,), 0, self.env.num_robots, jnp.int32)
        return self.env.reset(key_reset, index)

    def _observe(self, state: GoalState) -> dict[str, jax.Array]:
        obs = self._robot_inputs(state.index, state.obs)
        return {"observation": obs, "achieved_goal": state.achieved_goal, "desired_goal": state.desired_goal}

    def _reset_worlds(self, key):
        state = self._draw(key)
        return GoalWorlds(state, jnp.zeros(self.num_envs, jnp.int32)), self._observe(state)

    def _step_worlds(self, worlds, action):
        state, transition = self.env.step(worlds.goal, action)
        step_count = worlds.step_count + 1
        terminated = transition.success | transition.diverged
        truncated = ~terminated & (step_count >= self.env.episode_length)
        done = terminated | truncated
        key, key_draw = jax.random.split(state.key)
        fresh = self._draw(key_draw)
        following = select_rows(done, fresh.replace(key=None), state.replace(key=None)).replace(key=key)
        return GoalWorlds(following, jnp.where(done, 0, step_count)), {
            "obs": self._observe(following),
            "reward": transition.reward,
            "terminated": terminated,
            "truncated": truncated,
            "final_obs": self._observe(state),
            "is_success": transition.success & ~transition.diverged,
            "action": transition.action,
        }

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> np.ndarray:
        """The reward for another goal, as hindsight needs it.

        Args:
            achieved_goal, desired_goal: [..., G] m.
            info: what `step` said, as a dict or one dict per row, with the executed `action`.
        """
        action = info["action"] if isinstance(info, dict) else np.stack([row["action"] for row in info])
        return np.asarray(
            self.env.compute_reward(jnp.asarray(achieved_goal), jnp.asarray(desired_goal), jnp.asarray(action))[0]
        )


class SingleEnv(gymnasium.Env):
    """The one world of a vector environment of size 1."""

    def __init__(self, worlds: _VectorEnv):
        """Raises ValueError if `worlds` has more than one world."""
        if worlds.num_envs != 1:
            raise ValueError(f"num_envs={worlds.num_envs}: expected 1")
        self._worlds, self.episode_length = worlds, worlds.env.episode_length
        self.metadata = {"render_modes": []}
        self.observation_space, self.action_space = worlds.single_observation_space, worlds.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """The first observation of an episode."""
        super().reset(seed=seed)
        obs, infos = self._worlds.reset(seed=seed, options=options)
        return first_world(obs), first_world(infos)

    def step(self, action: np.ndarray):
        """One control step; the episode's last observation where it ends."""
        obs, reward, terminated, truncated, infos = self._worlds.step(np.asarray(action)[None])
        obs, final_obs = first_world(obs), infos.pop("final_obs", None)
        if final_obs is not None:
            obs, infos = final_obs[0], infos["final_info"]
        return obs, float(reward[0]), bool(terminated[0]), bool(truncated[0]), first_world(infos)

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> np.ndarray:
        """The reward for another goal, of a goal task."""
        return self._worlds.compute_reward(achieved_goal, desired_goal, info)


def first_world(batch: Any) -> Any:
    return jax.tree.map(lambda leaf: leaf[0], batch)

"""Goal-conditioned environments over an arm pool: B worlds in lockstep, whose episodes all last equally long.

The contract, each sentence a test:
- An episode does not end at success: success is a flag of each step, terminal for the learner alone.
- Noise is on the observation; the achieved goal is where the point of interest is.
- Joint velocities are observed up to `MAX_SPEED`: an arm whose physics is about to diverge spoils no statistics.
- A world whose physics is not plausible stays where it was last, and says so.
- Actions of missing joints are 0 and cost nothing.
- Where the task asks for approach starts, that share of episodes starts from the pool's `approach_angles`, with the goals that
  belong to them.
"""

from typing import Any, Protocol

import chex
import jax
import jax.numpy as jnp
from flax import struct

from hcp_jax.hardware.joint_slots import JointSlots
from hcp_jax.hardware.kinematics import joint_poses, quat_to_matrix
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.physics.base import Physics, PhysicsState, is_plausible, select_rows


@struct.dataclass
class GoalState:
    """State of B worlds. index: [B] int32 position in the pool; obs: [B, O]; achieved_goal, desired_goal: [B, G]."""

    physics: Any
    index: jax.Array
    obs: jax.Array
    achieved_goal: jax.Array
    desired_goal: jax.Array
    key: jax.Array


@struct.dataclass
class GoalTransition:
    """One control step of B worlds.

    action: [B, A] as executed; reward: [B]; success: [B] bool and distance: [B], of achieved from desired goal, after the step;
    diverged: [B] bool; overflow: [] int32.
    """

    action: jax.Array
    reward: jax.Array
    success: jax.Array
    distance: jax.Array
    diverged: jax.Array
    overflow: jax.Array


class GoalTask(Protocol):
    """What the arms are asked to do (`hcp_jax.envs.arm.ArmTask`)."""

    @property
    def observation_size(self) -> int: ...
    @property
    def action_size(self) -> int: ...
    @property
    def goal_size(self) -> int: ...
    @property
    def num_substeps(self) -> int: ...
    @property
    def episode_length(self) -> int: ...
    @property
    def observation_noise(self) -> float: ...
    @property
    def approach_starts(self) -> float: ...
    @property
    def joint_slots(self) -> str: ...
    def sample_goal(self, key: jax.Array, num_envs: int) -> jax.Array: ...
    def table_position(self, goal: jax.Array) -> jax.Array | None: ...
    def compute_reward(
        self, achieved_goal: jax.Array, desired_goal: jax.Array, action: jax.Array
    ) -> tuple[jax.Array, jax.Array]: ...


# What a pool's hardware has for approach starts: joint angles [N, K, 7] rad and their goals [N, K, 3] m.
APPROACH = ("approach_angles", "approach_goal")


# [rad/s] Faster joints are seen as that fast. One run's inputs were whitened by a standard deviation of 1e5 rad/s after a few
# episodes of arms whose physics diverged, and its success fell from 93 to 18 %.
MAX_SPEED = 100.0


class GoalEnv:
    """One task over one pool of arms. Stateless: everything that changes is in `GoalState`."""

    def __init__(self, task: GoalTask, pool: RobotPool, physics: Physics):
        self.task, self.pool, self.physics = task, pool, physics
        self.observation_size, self.action_size, self.goal_size = task.observation_size, task.action_size, task.goal_size
        self.num_robots, self.episode_length = pool.num_robots, task.episode_length
        self.compute_reward = task.compute_reward
        hardware = {name: jnp.asarray(values, jnp.float32) for name, values in pool.hardware.items()}
        self._chain_pos, self._chain_rotation = hardware["chain_pos"], quat_to_matrix(hardware["chain_quat"])
        self._joint_mask, self._start_angles = hardware["joint_mask"], hardware["start_angles"]
        self._slots = JointSlots(pool, task.joint_slots)
        self._approach = {name: hardware[name] for name in APPROACH if task.approach_starts}

    def reset(self, key: jax.Array, index: jax.Array) -> GoalState:
        """Starts an episode of the robots at positions `index` [B], each with a drawn start pose and goal."""
        key, key_pose, key_goal, key_approach, key_noise = jax.random.split(key, 5)
        num_envs = index.shape[0]
        pose = jax.random.randint(key_pose, (num_envs,), 0, self._start_angles.shape[1])
        desired_goal = self.task.sample_goal(key_goal, num_envs)
        qpos = self._start_angles[index, pose]
        if self._approach:
            qpos, desired_goal = self._start_near_goal(key_approach, index, qpos, desired_goal)
        physics = PhysicsState(
            qpos=qpos,
            qvel=jnp.zeros_like(qpos),
            qacc_warmstart=jnp.zeros_like(qpos),
            mocap_pos=self.task.table_position(desired_goal),
        )
        return GoalState(
            physics=physics,
            index=index,
            obs=self._observe(physics, index, key_noise),
            achieved_goal=self._point_of_interest(qpos, index),
            desired_goal=desired_goal,
            key=key,
        )

    def step(self, state: GoalState, action: jax.Array) -> tuple[GoalState, GoalTransition]:
        """One control step of every world. Actions are clipped to [-1, 1]."""
        chex.assert_shape(action, (state.index.shape[0], self.action_size))
        key, key_noise = jax.random.split(state.key)
        torque = self._slots.to_joints(jnp.clip(action, -1.0, 1.0), state.index) * self._joint_mask[state.index]
        after, overflow = self.physics.step(self.pool.take(state.index), state.physics, torque, self.task.num_substeps)
        action = self._slots.to_entries(torque, state.index)
        plausible = is_plausible(after)
        after = select_rows(plausible, after, state.physics)
        achieved_goal = self._point_of_interest(after.qpos, state.index)
        reward, success = self.compute_reward(achieved_goal, state.desired_goal, action)
        next_state = state.replace(
            physics=after, obs=self._observe(after, state.index, key_noise), achieved_goal=achieved_goal, key=key
        )
        transition = GoalTransition(
            action=action,
            reward=reward,
            success=success,
            distance=jnp.linalg.norm(achieved_goal - state.desired_goal, axis=-1),
            diverged=~plausible,
            overflow=overflow,
        )
        return next_state, transition

    def action_mask(self, index: jax.Array) -> jax.Array:
        """1 for the entries of actions that robots at `index` [B] have a joint for, else 0: [B, A]."""
        return self._slots.to_entries(self._joint_mask[index], index)

    def _start_near_goal(
        self, key: jax.Array, index: jax.Array, qpos: jax.Array, desired_goal: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """Puts the task's share of episodes at one of their robots' approach poses, with its goal."""
        key_share, key_pose = jax.random.split(key)
        angles, goals = (self._approach[name] for name in APPROACH)
        pose = jax.random.randint(key_pose, index.shape, 0, angles.shape[1])
        chosen = jax.random.uniform(key_share, index.shape) < self.task.approach_starts
        return (
            jnp.where(chosen[:, None], angles[index, pose], qpos),
            jnp.where(chosen[:, None], goals[index, pose], desired_goal),
        )

    def _observe(self, physics: PhysicsState, index: jax.Array, key: jax.Array) -> jax.Array:
        """Noisy joint angles and velocities, 0 for missing joints: [B, 14]."""
        state = jnp.concatenate([physics.qpos, jnp.clip(physics.qvel, -MAX_SPEED, MAX_SPEED)], axis=-1)
        noise = jax.random.uniform(key, state.shape, minval=-1.0, maxval=1.0) * self.task.observation_noise
        seen = (state + noise) * jnp.tile(self._joint_mask[index], 2)
        return jnp.concatenate([self._slots.to_entries(part, index) for part in jnp.split(seen, 2, axis=-1)], axis=-1)

    def _point_of_interest(self, qpos: jax.Array, index: jax.Array) -> jax.Array:
        """[B, 3] m in the world."""
        angles = qpos * self._joint_mask[index]
        return joint_poses(self._chain_pos[index], self._chain_rotation[index], angles)[0][:, -1]

"""One arm under a policy, in the task's own environment, whose type, links and goal change while it moves."""

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.envs.arm import HOLE, REACHER_GOALS
from hcp_jax.experiment.arm import ArmExperiment, make_evaluator
from hcp_jax.hardware.arm import TYPES, arm_spec, change_lengths
from hcp_jax.hardware.arm_pool import CHAIN_TEMPLATES, make_chain_pool
from hcp_jax.hardware.chain import read_chain
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.start_poses import start_angles

HOLE_BOX = 0.1  # [m] half the side of the box that a hole can be dragged in (paper: 0.2 m box)


def make_one_arm(task: str, robot_type: str, length_change: np.ndarray) -> RobotPool:
    """A pool of one arm with nominal masses and joint dynamics, its links changed by `length_change` [10] m.

    The arm of type K is one robot that exists: its links stay.
    """
    spec = arm_spec(task, robot_type)
    if robot_type != "K":
        change_lengths(spec, length_change)
    chain, number = read_chain(spec.compile()), TYPES.index(robot_type)
    return make_chain_pool(
        CHAIN_TEMPLATES[task], [chain], np.array([0]), np.array([number]), start_angles(task, robot_type)[None]
    )


class LiveArm:
    """The arm, moving step by step.

    Attributes:
        pool: the arm as a pool of one.
        goal_box: [2, 3] m, low and high corner of where goals may be.
        state: the environment's, of one world.
        distance: [m] of the point of interest from the goal.
    """

    def __init__(self, run: ArmExperiment, params, seed: int = 0):
        """Args:
        run: the experiment that the policy comes from.
        params: the policy's, `run.learner.policy(state)`.
        seed: of start poses, the first goal and noise.
        """
        self._run, self._params, self._key = run, params, jax.random.key(seed)
        is_reacher = run.config.task == "reacher"
        self.goal_box = np.asarray(REACHER_GOALS) if is_reacher else np.add(HOLE, [[-HOLE_BOX], [HOLE_BOX]])
        self._goal: np.ndarray | None = None

    @property
    def qpos(self) -> np.ndarray:
        """[7] rad."""
        return np.asarray(self.state.physics.qpos[0])

    @property
    def goal(self) -> np.ndarray:
        """[3] m."""
        return np.asarray(self.state.desired_goal[0])

    def set_robot(self, robot_type: str, length_change: np.ndarray) -> None:
        """Another arm, at a start pose of its own; the goal stays. Takes a second or two: the policy is compiled for it."""
        self.pool = make_one_arm(self._run.config.task, robot_type, length_change)
        self._evaluator = make_evaluator(
            self._run.config, self._run.learner, self._run.make_env, self.pool, self._run.train_pool
        )
        self._step = jax.jit(self._evaluator.step)
        self.restart()

    def restart(self) -> None:
        """Puts the arm at one of its start poses; the goal, drawn for the first arm, stays."""
        self._key, key = jax.random.split(self._key)
        self.state = self._evaluator.env.reset(key, jnp.zeros(1, jnp.int32))
        self.set_goal(self.goal if self._goal is None else self._goal)

    def set_goal(self, goal: np.ndarray) -> None:
        """Moves the goal to `goal` [3] m, clipped to `goal_box`, and the table with it."""
        self._goal = np.clip(goal, *self.goal_box)
        desired_goal = jnp.asarray(self._goal, jnp.float32)[None]
        table = self._evaluator.env.task.table_position(desired_goal)
        self.state = self.state.replace(desired_goal=desired_goal, physics=self.state.physics.replace(mocap_pos=table))
        self.distance = float(jnp.linalg.norm(self.state.achieved_goal - desired_goal))

    def step(self) -> None:
        """One control step, 20 ms. Goes on after success."""
        self.state, transition = self._step(self._params, self.state)
        self.distance = float(transition.distance[0])

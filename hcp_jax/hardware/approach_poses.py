"""Poses of each arm with its point of interest upright at a goal or above it: the starts of a reverse curriculum."""

import dataclasses

import jax
import numpy as np

from hcp_jax.hardware.inverse_kinematics import MAX_TILT, solve_positions
from hcp_jax.hardware.pool import RobotPool

NUM_POSES = 8
MAX_HEIGHT = 0.15  # [m] above the goal
_MAX_DISTANCE = 5e-3  # [m] of a pose from where it should be


def add_approach_poses(pool: RobotPool, goal: np.ndarray, goal_box: float, seed: int) -> RobotPool:
    """Solves, for each arm, `NUM_POSES` poses over goals drawn in a box; arms that have no such pose keep their start pose.

    Args:
        pool: N arms.
        goal: [3] m, the box's centre.
        goal_box: its side [m].
        seed: of the goals, the heights and the solver's starts.

    Returns:
        the pool with hardware `approach_angles` [N, K, 7] rad and their goals `approach_goal` [N, K, 3] m.
    """
    rng, num_robots = np.random.default_rng(seed), pool.num_robots
    goals = goal + goal_box * rng.uniform(-0.5, 0.5, (num_robots, NUM_POSES, 3))
    points = goals + MAX_HEIGHT * rng.uniform(0.0, 1.0, (num_robots, NUM_POSES, 1)) * np.array([0.0, 0.0, 1.0])
    key = jax.random.key(seed)
    above = solve_positions(pool, np.tile(goal, (num_robots, 1)), key, upright=True).angles
    repeated = pool.subset(np.repeat(np.arange(num_robots), NUM_POSES))
    starts = np.repeat(above, NUM_POSES, axis=0)[:, None]
    solution = solve_positions(repeated, points.reshape(-1, 3), key, upright=True, starts=starts)
    solved = ((solution.distance < _MAX_DISTANCE) & (solution.tilt < MAX_TILT)).reshape(num_robots, NUM_POSES, 1)
    angles = np.where(solved, solution.angles.reshape(num_robots, NUM_POSES, -1), pool.hardware["start_angles"][:, :1])
    hardware = {"approach_angles": np.asarray(angles, np.float64), "approach_goal": goals}
    return dataclasses.replace(pool, hardware=pool.hardware | hardware)

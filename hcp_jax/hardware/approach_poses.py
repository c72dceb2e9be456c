"""Poses of each arm with its point of interest upright at a goal or above it: the starts of a reverse curriculum."""

import dataclasses

import jax
import numpy as np

from hcp_jax.hardware.inverse_kinematics import MAX_TILT, solve_positions
from hcp_jax.hardware.pool import RobotPool

NUM_POSES = 8
MAX_HEIGHT = 0.15  # [m] above the goal
NUM_NEAR_STARTS = 8
_NEAR = 0.8  # [rad] half-width of their spread
_MAX_DISTANCE = 5e-3  # [m] of a pose from where it should be


def add_approach_poses(pool: RobotPool, goal: np.ndarray, goal_box: float, seed: int) -> RobotPool:
    """Solves, for each arm, `NUM_POSES` poses over goals drawn in a box; arms that have no such pose keep their start pose.

    They are near the arm's start pose: of the ways to stand over a hole, an arm learns the one that it comes by.

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
    above = find_near_poses(pool, np.tile(goal, (num_robots, 1)), seed)
    repeated = pool.subset(np.repeat(np.arange(num_robots), NUM_POSES))
    starts = np.repeat(above, NUM_POSES, axis=0)[:, None]
    solution = solve_positions(repeated, points.reshape(-1, 3), key, upright=True, starts=starts)
    solved = ((solution.distance < _MAX_DISTANCE) & (solution.tilt < MAX_TILT)).reshape(num_robots, NUM_POSES, 1)
    angles = np.where(solved, solution.angles.reshape(num_robots, NUM_POSES, -1), pool.hardware["start_angles"][:, :1])
    hardware = {"approach_angles": np.asarray(angles, np.float64), "approach_goal": goals}
    return dataclasses.replace(pool, hardware=pool.hardware | hardware)


def find_near_poses(pool: RobotPool, goal: np.ndarray, seed: int) -> np.ndarray:
    """Angles of each arm with its point of interest upright at its goal [N, 3]: [N, 7] rad.

    Of the solutions from `NUM_NEAR_STARTS` starts around the start pose, the one with the least turned joint; where there is
    none, the best from anywhere.
    """
    rng, first = np.random.default_rng(seed), pool.hardware["start_angles"][:, :1]
    key = jax.random.key(seed)
    best = solve_positions(pool, goal, key, upright=True).angles
    least = np.full(pool.num_robots, np.inf)
    for _ in range(NUM_NEAR_STARTS):
        starts = first + rng.uniform(-_NEAR, _NEAR, first.shape)
        solution = solve_positions(pool, goal, key, upright=True, starts=starts)
        solved = (solution.distance < _MAX_DISTANCE) & (solution.tilt < MAX_TILT)
        turn = np.where(solved, np.abs(solution.angles - first[:, 0]).max(axis=1), np.inf)
        best = np.where((turn < least)[:, None], solution.angles, best)
        least = np.minimum(least, turn)
    return best

"""Inverse kinematics within joint limits, collisions ignored, for many arms at once: what they can reach, and how."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.hardware.kinematics import exact_einsum, joint_poses, quat_to_matrix
from hcp_jax.hardware.pool import RobotPool

NUM_STARTS, NUM_FIRST_STARTS, NUM_STEPS = 24, 4, 60
_BLOCK = 100
_DAMPING = 1e-3
MAX_TILT = np.deg2rad(10.0)  # of a peg in its hole
_TILT_WEIGHT = 0.05  # [m/rad]


class Solution(NamedTuple):
    """angles [N, 7] rad, 0 for missing joints; distance [N] m of the point of interest from its goal; tilt [N] rad of its z
    axis from upright, 0 where that was not asked for."""

    angles: np.ndarray
    distance: np.ndarray
    tilt: np.ndarray


def solve_positions(
    pool: RobotPool, goal: np.ndarray, key: jax.Array, upright: bool = False, starts: np.ndarray | jax.Array | None = None
) -> Solution:
    """Brings the point of interest as near to a goal as it comes, by damped least squares.

    Args:
        pool: N arms.
        goal: [N, 3] m, one for each.
        key: for random starts.
        upright: also ask for the z axis of the point of interest to stand upright.
        starts: angles to start from [N, S, 7] rad, of which the best end counts; by default `NUM_STARTS` random ones.
    """
    if starts is None:
        starts = _random_starts(pool, key)
    hardware = {name: jnp.asarray(pool.hardware[name], jnp.float32) for name in ("chain_pos", "chain_quat", "joint_range")}
    rotation = quat_to_matrix(hardware["chain_quat"])
    low, high = jnp.moveaxis(hardware["joint_range"], -1, 0)
    mask = jnp.asarray(pool.hardware["joint_mask"], jnp.float32)
    solution = _solve_arms(hardware["chain_pos"], rotation, low, high, mask, jnp.asarray(goal), jnp.asarray(starts), upright)
    return Solution(*map(np.asarray, solution))


def _random_starts(pool: RobotPool, key: jax.Array) -> np.ndarray:
    """[N, NUM_STARTS, 7] rad within the joints' ranges."""
    low, high = np.moveaxis(pool.hardware["joint_range"], -1, 0)[:, :, None]
    return low + np.asarray(jax.random.uniform(key, (pool.num_robots, NUM_STARTS, low.shape[-1]))) * (high - low)


def is_reachable(pool: RobotPool, goal: np.ndarray, within: float, key: jax.Array, upright: bool = False) -> np.ndarray:
    """Whether each arm can bring its point of interest `within` [m] of its goal [N, 3], and if asked upright: [N] bool."""
    starts = _random_starts(pool, key)
    reachable = np.zeros(pool.num_robots, bool)
    # Most arms get there from one of few starts; the others try the rest.
    for tried in (slice(0, NUM_FIRST_STARTS), slice(NUM_FIRST_STARTS, NUM_STARTS)):
        rows = np.flatnonzero(~reachable)
        if len(rows):
            padded = np.resize(rows, -(-len(rows) // _BLOCK) * _BLOCK)  # few shapes, so few compilations
            solution = solve_positions(pool.subset(padded), goal[padded], key, upright, starts[padded, tried])
            reachable[padded] |= (solution.distance < within) & (solution.tilt < MAX_TILT)
    return reachable


@functools.partial(jax.jit, static_argnames="upright")
def _solve_arms(chain_pos, chain_rotation, low, high, mask, goal, starts, upright: bool):
    solve = functools.partial(_solve_arm, upright=upright)
    return jax.vmap(solve)(chain_pos, chain_rotation, low, high, mask, goal, starts)


def _solve_arm(chain_pos, chain_rotation, low, high, mask, goal, starts, *, upright: bool):
    """The best angles of one arm over its starts [S, 7], with their distance and tilt."""

    def pose(angles):
        positions, rotations = joint_poses(chain_pos, chain_rotation, angles * mask)
        return positions[-1] - goal, jnp.arccos(jnp.clip(rotations[-1, 2, 2], -1.0, 1.0))

    def residual(angles):
        positions, rotations = joint_poses(chain_pos, chain_rotation, angles * mask)
        error = positions[-1] - goal
        # The axis' horizontal part, and 1 minus its vertical one, which tells up from down.
        tilt = jnp.array([rotations[-1, 0, 2], rotations[-1, 1, 2], 1.0 - rotations[-1, 2, 2]])
        return jnp.concatenate([error, _TILT_WEIGHT * tilt]) if upright else error

    def step(angles, _):
        error, jacobian = residual(angles), jax.jacfwd(residual)(angles)
        normal = exact_einsum("ij,ik->jk", jacobian, jacobian) + _DAMPING * jnp.eye(angles.shape[0])
        return jnp.clip(angles - jnp.linalg.solve(normal, exact_einsum("ij,i->j", jacobian, error)), low, high), None

    def solve(start):
        angles = jax.lax.scan(step, start, None, length=NUM_STEPS)[0]
        error, tilt = pose(angles)
        return angles * mask, jnp.linalg.norm(error), tilt if upright else jnp.zeros(())

    angles, distance, tilt = jax.vmap(solve)(starts)
    best = jnp.argmin(distance + _TILT_WEIGHT * tilt)
    return angles[best], distance[best], tilt[best]

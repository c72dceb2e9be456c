"""Which goals an arm can reach at all: inverse kinematics within joint limits, collisions ignored, for many arms at once."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.hardware.kinematics import joint_poses, quat_to_matrix
from hcp_jax.hardware.pool import RobotPool

NUM_STARTS, NUM_STEPS = 24, 60
_DAMPING = 1e-3
MAX_TILT = np.deg2rad(10.0)  # of a peg in its hole
_TILT_WEIGHT = 0.05  # [m/rad]


def solve_positions(pool: RobotPool, goal: np.ndarray, key: jax.Array, upright: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """How near the point of interest can come to a goal; damped least squares from random angles, the best of `NUM_STARTS`.

    Args:
        pool: N arms.
        goal: [N, 3] m, one for each.
        key: for the starts.
        upright: also ask for the z axis of the point of interest to stand upright.

    Returns:
        distance [N] in m and tilt [N] in rad (0 unless `upright`) of the best solution.
    """
    hardware = {name: jnp.asarray(values, jnp.float32) for name, values in pool.hardware.items()}
    rotation = quat_to_matrix(hardware["chain_quat"])
    low, high = jnp.moveaxis(hardware["joint_range"], -1, 0)
    share = jax.random.uniform(key, (NUM_STARTS, *low.shape))
    starts = jnp.swapaxes(low + share * (high - low), 0, 1)
    solve = jax.jit(jax.vmap(functools.partial(_solve_arm, upright=upright)))
    distance, tilt = solve(hardware["chain_pos"], rotation, low, high, hardware["joint_mask"], jnp.asarray(goal), starts)
    return np.asarray(distance), np.asarray(tilt)


def is_reachable(pool: RobotPool, goal: np.ndarray, within: float, key: jax.Array, upright: bool = False) -> np.ndarray:
    """Whether each arm can bring its point of interest `within` [m] of its goal [N, 3], and if asked upright: [N] bool."""
    distance, tilt = solve_positions(pool, goal, key, upright)
    return (distance < within) & (tilt < MAX_TILT)


def _solve_arm(chain_pos, chain_rotation, low, high, mask, goal, starts, *, upright: bool):
    """The best distance and tilt of one arm over its starts [S, 7]."""

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
        normal = jacobian.T @ jacobian + _DAMPING * jnp.eye(angles.shape[0])
        return jnp.clip(angles - jnp.linalg.solve(normal, jacobian.T @ error), low, high), None

    def solve(start):
        angles = jax.lax.scan(step, start, None, length=NUM_STEPS)[0]
        error, tilt = pose(angles)
        return jnp.linalg.norm(error), tilt if upright else jnp.zeros(())

    distance, tilt = jax.vmap(solve)(starts)
    best = jnp.argmin(distance + _TILT_WEIGHT * tilt)
    return distance[best], tilt[best]

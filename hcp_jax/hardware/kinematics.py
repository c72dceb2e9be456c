"""Forward kinematics of padded chains, differentiable, for any batch of different arms.

Products are of full float32 (`exact_einsum`, for geometry elsewhere too): by default a GPU rounds factors to 10 bits (TF32).
"""

import functools

import chex
import jax
import jax.numpy as jnp

exact_einsum = functools.partial(jnp.einsum, precision=jax.lax.Precision.HIGHEST)


def quat_to_matrix(quat: jax.Array) -> jax.Array:
    """Rotation matrices [..., 3, 3] of unit quaternions [..., 4], w first."""
    w, x, y, z = jnp.moveaxis(quat, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_euler(rotation: jax.Array) -> jax.Array:
    """Angles (x, y, z) [..., 3] in rad with rotation = Rx(x) Ry(y) Rz(z), y in [-pi/2, pi/2]; at |y| = pi/2, z is 0."""
    sine = jnp.clip(rotation[..., 0, 2], -1.0, 1.0)
    locked = jnp.abs(sine) > 1.0 - 1e-6
    x = jnp.arctan2(-rotation[..., 1, 2], rotation[..., 2, 2])
    z = jnp.arctan2(-rotation[..., 0, 1], rotation[..., 0, 0])
    locked_x = jnp.arctan2(rotation[..., 2, 1], rotation[..., 1, 1])
    return jnp.stack([jnp.where(locked, locked_x, x), jnp.arcsin(sine), jnp.where(locked, 0.0, z)], axis=-1)


def joint_poses(chain_pos: jax.Array, chain_rotation: jax.Array, angles: jax.Array) -> tuple[jax.Array, jax.Array]:
    """World poses of each joint and of the point of interest.

    Args:
        chain_pos: [..., 8, 3] and
        chain_rotation: [..., 8, 3, 3], the frame of each joint (turning about z) in that of the one before, at angle 0, and
            last the point of interest's (`hcp_jax.hardware.arm_pool.make_chain_pool`). An arm of n joints has its point of
            interest at n and the identity after it.
        angles: [..., 7] rad; those of missing joints are ignored where they are 0.

    Returns:
        positions [..., 8, 3] in m and rotations [..., 8, 3, 3]; from an arm's point of interest on they repeat its pose, so the
        last is the point of interest for every arm.
    """
    chex.assert_equal(chain_pos.shape[-2], angles.shape[-1] + 1)
    cosine, sine, zero, one = jnp.cos(angles), jnp.sin(angles), jnp.zeros_like(angles), jnp.ones_like(angles)
    turn = jnp.stack(
        [jnp.stack([cosine, -sine, zero], -1), jnp.stack([sine, cosine, zero], -1), jnp.stack([zero, zero, one], -1)], -2
    )
    position = jnp.zeros((*angles.shape[:-1], 3))
    rotation = jnp.broadcast_to(jnp.eye(3), (*angles.shape[:-1], 3, 3))
    positions, rotations = [], []
    for i in range(chain_pos.shape[-2]):
        position = position + exact_einsum("...ij,...j->...i", rotation, chain_pos[..., i, :])
        rotation = exact_einsum("...ij,...jk->...ik", rotation, chain_rotation[..., i, :, :])
        if i < angles.shape[-1]:
            rotation = exact_einsum("...ij,...jk->...ik", rotation, turn[..., i, :, :])
        positions.append(position)
        rotations.append(rotation)
    return jnp.stack(positions, axis=-2), jnp.stack(rotations, axis=-3)

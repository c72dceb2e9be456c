"""Explicit encodings of arms: the fixed vector v_h of each robot in a pool.

| encoding | length | content |
|---|---|---|
| `none` | 0 | nothing |
| `chain` | 48 | the paper's formula: relative position [m] and Euler angles [rad] of consecutive joints, base first, the end effector after the last joint, then zeros: 8 x (3 + 3) |
| `dynamics` | 28 | 7 link masses, 7 frictionloss, 7 damping, 7 armature in [0, 1], zeros for missing joints |
| `chain+dynamics` | 76 | both |
| `random` | 28 | uniform noise in [0, 1], fixed per robot: a control for `dynamics` |

Dynamics are scaled by the training pool's minimum and maximum, so a held-out robot may lie slightly outside [0, 1].
"""  # noqa: E501

import jax
import numpy as np

from hcp_jax.hardware.encodings import random_encoding, scale_to_unit
from hcp_jax.hardware.kinematics import matrix_to_euler, quat_to_matrix
from hcp_jax.hardware.pool import RobotPool

ARM_ENCODINGS = ("none", "chain", "dynamics", "chain+dynamics", "random")
_DYNAMICS = ("link_mass", "frictionloss", "damping", "armature")


def encode_arms(pool: RobotPool, encoding: str, reference: RobotPool) -> np.ndarray:
    """The encoding of every arm in `pool`: [N, K] float32, scaled by the ranges in `reference`.

    Raises:
        ValueError: `encoding` is not one of `ARM_ENCODINGS`.
    """
    if encoding == "none":
        return np.zeros((pool.num_robots, 0), np.float32)
    if encoding == "chain":
        return _chain(pool)
    if encoding == "dynamics":
        return _dynamics(pool, reference)
    if encoding == "chain+dynamics":
        return np.concatenate([_chain(pool), _dynamics(pool, reference)], axis=1)
    if encoding == "random":
        return random_encoding(pool, width=_dynamics_values(pool).shape[1])
    raise ValueError(f"encoding={encoding!r}: expected one of {', '.join(ARM_ENCODINGS)}")


def _chain(pool: RobotPool) -> np.ndarray:
    """Paper, section 4.1: v_h = P_-1 + P_0 + ... + P_(n-1), each d_i + e_i."""
    euler = jax.device_get(matrix_to_euler(quat_to_matrix(pool.hardware["chain_quat"])))
    poses = np.concatenate([pool.hardware["chain_pos"], euler], axis=-1)
    return poses.reshape(pool.num_robots, -1).astype(np.float32)


def _dynamics(pool: RobotPool, reference: RobotPool) -> np.ndarray:
    present = np.tile(pool.hardware["joint_mask"], len(_DYNAMICS))
    return (scale_to_unit(_dynamics_values(pool), _dynamics_values(reference)) * present).astype(np.float32)


def _dynamics_values(pool: RobotPool) -> np.ndarray:
    return np.concatenate([pool.hardware[name] for name in _DYNAMICS], axis=1)

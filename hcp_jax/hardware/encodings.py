"""Explicit encodings of hardware: the fixed vector v_h of each robot in a pool.

| encoding | length for the hopper | content |
|---|---|---|
| `none` | 0 | nothing |
| `kinematics` | 4 | half-lengths of torso, thigh, leg, foot, standardised by the training pool's mean and std |
| `kinematics+dynamics` | 17 | `kinematics`, then 4 body masses, 3 frictionloss, 3 damping, 3 armature, in [0, 1] |
| `random` | 17 | uniform noise, fixed per robot: a control for `kinematics+dynamics` |

Masses and joint dynamics are scaled to [0, 1] by the training pool's minimum and maximum.
The scales come from the training pool, so a held-out robot may lie slightly outside [0, 1].
"""

import numpy as np

from hcp_jax.hardware.pool import RobotPool

ENCODINGS = ("none", "kinematics", "kinematics+dynamics", "random")
_DYNAMICS = ("body_mass", "frictionloss", "damping", "armature")
_RANDOM_ENCODING_SEED = 7919
# Where a pool's episodes start: as many poses as the pool's other robots have.
_NOT_HARDWARE = {"start_angles", "approach_angles", "approach_goal"}


def encode(pool: RobotPool, encoding: str, reference: RobotPool) -> np.ndarray:
    """The encoding of every robot in `pool`: [N, K] float32, scaled by the statistics of `reference`.

    Raises:
        ValueError: `encoding` is not one of `ENCODINGS`.
    """
    if encoding == "none":
        return np.zeros((pool.num_robots, 0), np.float32)
    if encoding == "kinematics":
        return _kinematics(pool, reference)
    if encoding == "kinematics+dynamics":
        return np.concatenate([_kinematics(pool, reference), _dynamics(pool, reference)], axis=1)
    if encoding == "random":
        return _random(pool)
    raise ValueError(f"encoding={encoding!r}: expected one of {', '.join(ENCODINGS)}")


def _kinematics(pool: RobotPool, reference: RobotPool) -> np.ndarray:
    half, reference_half = pool.hardware["link_length"] / 2, reference.hardware["link_length"] / 2
    std = reference_half.std(axis=0)
    return ((half - reference_half.mean(axis=0)) / np.where(std > 1e-9, std, 1.0)).astype(np.float32)


def _dynamics(pool: RobotPool, reference: RobotPool) -> np.ndarray:
    values = [np.concatenate([robots.hardware[name] for name in _DYNAMICS], axis=1) for robots in (pool, reference)]
    return scale_to_unit(*values).astype(np.float32)


def _random(pool: RobotPool) -> np.ndarray:
    return random_encoding(pool, sum(pool.hardware[name].shape[1] for name in ("link_length", *_DYNAMICS)))


def scale_to_unit(values: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Columns of `values` [N, K] scaled so that those of `reference` [M, K] span [0, 1]; constant ones are only shifted."""
    low, high = reference.min(axis=0), reference.max(axis=0)
    return (values - low) / np.where(high - low > 1e-9, high - low, 1.0)


def random_encoding(pool: RobotPool, width: int) -> np.ndarray:
    """Noise [N, width] keyed by the robot's own hardware, so a robot keeps its vector whatever pool it stands in."""
    names, rows = sorted(set(pool.hardware) - _NOT_HARDWARE), []
    for row in range(pool.num_robots):
        parts = [np.ascontiguousarray(pool.hardware[name][row]).tobytes() for name in names]
        digest = np.frombuffer(b"".join(parts), np.uint32)
        rows.append(np.random.default_rng([_RANDOM_ENCODING_SEED, *digest]).uniform(size=width))
    return np.asarray(rows, np.float32)

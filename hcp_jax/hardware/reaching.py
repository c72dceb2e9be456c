"""Joint angles near 0 that bring an arm's point of interest to given points: where the arms of the reacher start from.

In numpy, for many arms and points at once; `inverse_kinematics` asks what an arm can reach from anywhere.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from hcp_jax.hardware.chain import MAX_JOINTS, Chain

MAX_ERROR = 0.01  # [m]
_SPREADS = (0.05, np.pi)  # [rad] of the angles that are tried first, about 0
_NUM_STEPS, _DAMPING = 15, 1e-3
_ANGLE_WEIGHT = 0.05  # [m/rad] of the angles' root mean square beside the distance, where two of those compete
_BLOCK = 100  # arms at once
_NUM_COARSE = 200  # poses that `come_near` looks at


def reach_points(
    chains: Sequence[Chain], points: np.ndarray, seed: int, num_samples: int = 512, num_starts: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Of a sample of angle sets about 0 the best, improved by damped least squares within joint limits.

    Args:
        chains: N arms.
        points: [N, P, 3] m.
        seed: of the angle sets, which all arms share.
        num_samples, num_starts: angle sets, and how many of them are improved for each point.

    Returns:
        angles [N, P, 7] rad, those of the smallest root mean square that come within `MAX_ERROR` of their point, or else the
        nearest; and their distance [N, P] m.
    """
    rng = np.random.default_rng(seed)
    samples = rng.uniform(-1.0, 1.0, (num_samples, MAX_JOINTS)) * np.geomspace(*_SPREADS, num_samples)[:, None]
    blocks = [slice(first, first + _BLOCK) for first in range(0, len(chains), _BLOCK)]
    solved = [_reach(chains[block], points[block], samples, num_starts) for block in blocks]
    return np.concatenate([angles for angles, _ in solved]), np.concatenate([distance for _, distance in solved])


def come_near(chains: Sequence[Chain], points: np.ndarray, distance: float) -> np.ndarray:
    """Whether each arm comes within `distance` [m] of every one of `points` [P, 3] among a few sampled poses: [N] bool. A cheap
    test: it may miss arms that do, seldom for a `distance` of 0.2 m."""
    samples = np.random.default_rng(0).uniform(-np.pi, np.pi, (_NUM_COARSE, MAX_JOINTS))
    near = []
    for chain in chains:
        arm = _stack([chain])
        tips = _poses(arm.pos, arm.rotation, np.clip(samples, arm.low, arm.high))[0][0, :, -1]
        near.append((np.linalg.norm(tips[:, None] - points, axis=-1).min(axis=0) < distance).all())
    return np.asarray(near)


class _Arms(NamedTuple):
    """pos [N, 1, 8, 3], rotation [N, 1, 8, 3, 3], low, high [N, 1, 7] rad, mask [N, 1, 7]."""

    pos: np.ndarray
    rotation: np.ndarray
    low: np.ndarray
    high: np.ndarray
    mask: np.ndarray


def _stack(chains: Sequence[Chain]) -> _Arms:
    quats = np.stack([chain.padded("quat") for chain in chains])
    rotation = np.zeros((*quats.shape[:-1], 9))
    for index in np.ndindex(quats.shape[:-1]):
        mujoco.mju_quat2Mat(rotation[index], quats[index])
    low, high = np.moveaxis(np.stack([chain.padded("joint_range") for chain in chains])[:, None], -1, 0)
    mask = np.asarray([np.arange(MAX_JOINTS) < chain.num_joints for chain in chains], np.float64)[:, None]
    pos = np.stack([chain.padded("pos") for chain in chains])
    return _Arms(pos[:, None], rotation.reshape((*quats.shape[:-1], 3, 3))[:, None], low, high, mask)


def _reach(chains: Sequence[Chain], points: np.ndarray, samples: np.ndarray, num_starts: int) -> tuple[np.ndarray, np.ndarray]:
    arms = _stack(chains)
    angles = np.clip(samples, arms.low, arms.high)  # 0 where joints are missing
    tips = _poses(arms.pos, arms.rotation, angles)[0][..., -1, :]
    distance = np.linalg.norm(tips[:, None] - points[:, :, None], axis=-1)
    cost = distance + _ANGLE_WEIGHT * np.sqrt(np.mean(np.square(angles), axis=-1))[:, None]
    chosen = np.argpartition(cost, num_starts, axis=-1)[..., :num_starts].reshape(len(chains), -1, 1)  # [N, P * S, 1]
    angles, goal = np.take_along_axis(angles, chosen, axis=1), np.repeat(points, num_starts, axis=1)
    for _ in range(_NUM_STEPS):
        anchors, axes = _poses(arms.pos, arms.rotation, angles)
        error = goal - anchors[..., -1, :]
        jacobian = np.cross(axes[..., :-1, :], anchors[..., -1:, :] - anchors[..., :-1, :]) * arms.mask[..., None]
        normal = np.einsum("...ji,...jk->...ik", jacobian, jacobian) + _DAMPING * np.eye(3)
        step = np.linalg.solve(normal, error[..., None])
        angles = np.clip(angles + (jacobian @ step)[..., 0], arms.low, arms.high)
    distance = np.linalg.norm(goal - _poses(arms.pos, arms.rotation, angles)[0][..., -1, :], axis=-1)
    shape = (*points.shape[:2], num_starts)
    distance, angles = distance.reshape(shape), angles.reshape(*shape, MAX_JOINTS)
    size = np.sqrt(np.mean(np.square(angles), axis=-1))
    best = np.argmin(np.where(distance < MAX_ERROR, size, 1e3 + distance), axis=-1)[..., None]
    return np.take_along_axis(angles, best[..., None], axis=2)[:, :, 0], np.take_along_axis(distance, best, axis=2)[..., 0]


def _poses(pos: np.ndarray, rotation: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions [N, B, 8, 3] and z axes [N, B, 8, 3] of the joints and, last, the point of interest; pos [N, 1, 8, 3],
    rotation [N, 1, 8, 3, 3], angles [N, B, 7]. As `kinematics.joint_poses`."""
    position, turned = np.zeros((*angles.shape[:-1], 3)), np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    cosine, sine = np.cos(angles)[..., None], np.sin(angles)[..., None]
    positions, axes = [], []
    for i in range(pos.shape[-2]):
        position = position + (turned @ pos[..., i, :, None])[..., 0]
        turned = turned @ rotation[..., i, :, :]
        if i < MAX_JOINTS:
            x, y = turned[..., 0], turned[..., 1]
            c, s = cosine[..., i, :], sine[..., i, :]
            turned = np.stack([c * x + s * y, c * y - s * x, turned[..., 2]], axis=-1)
        positions.append(position)
        axes.append(turned[..., 2])
    return np.stack(positions, axis=-2), np.stack(axes, axis=-2)

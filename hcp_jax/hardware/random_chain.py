"""Random serial arms of 4 to 7 hinges, drawn in ranges that enclose the arms of the catalogue (`ChainRanges`)."""

import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from hcp_jax.hardware.chain import GRAVITY, MAX_JOINTS, Chain
from hcp_jax.hardware.ranges import ChainRanges, RangeError, sample_logarithmic, sample_uniform
from hcp_jax.hardware.reaching import MAX_ERROR, come_near, reach_points
from hcp_jax.hardware.start_poses import GRID, REACHER_GOALS

_SHORTEST = 0.05  # link that has a length, as a share of the longest
_TURN = np.pi / 2
MIN_JOINTS = 3  # that reach points in a volume, all links needed
NUM_STARTS = 8  # start poses of each arm, of the points of `GRID`
_MIN_STARTS = 4  # of them that it has to reach
_NEAR = 0.2  # [m]
_MAX_DRAWS = 2000  # of one arm


def sample_reaching_chains(
    ranges: ChainRanges, num_joints: int, count: int, seed: Sequence[int]
) -> tuple[list[Chain], np.ndarray]:
    """Draws arms until there are `count` that reach the corners of the reacher's goals and half of their start points.

    Arm i is the same whatever `count` is.

    Returns:
        the arms, and their start poses [count, NUM_STARTS, 7] rad; some of them more than once where points are out of reach.

    Raises:
        RangeError: some arm was drawn `_MAX_DRAWS` times in vain.
    """
    grid, corners = (np.asarray(list(itertools.product(*axes))) for axes in (GRID, zip(*REACHER_GOALS, strict=True)))
    generators = [np.random.default_rng([*seed, robot]) for robot in range(count)]
    chains: dict[int, Chain] = {}
    starts = np.zeros((count, NUM_STARTS, MAX_JOINTS))
    for _ in range(_MAX_DRAWS):
        missing = [robot for robot in range(count) if robot not in chains]
        if not missing:
            return [chains[robot] for robot in range(count)], starts
        drawn = [sample_chain(ranges, num_joints, generators[robot]) for robot in missing]
        points = np.stack([np.concatenate([corners, generators[i].permutation(grid)[:NUM_STARTS]]) for i in missing])
        near = np.flatnonzero(come_near(drawn, corners, _NEAR))
        if not len(near):
            continue
        angles, distance = reach_points([drawn[i] for i in near], points[near], seed[0])
        reached = distance < MAX_ERROR
        good = reached[:, : len(corners)].all(axis=1) & (reached[:, len(corners) :].sum(axis=1) >= _MIN_STARTS)
        for row in np.flatnonzero(good):
            robot = missing[near[row]]
            chains[robot] = drawn[near[row]]
            poses = angles[row, len(corners) :][reached[row, len(corners) :]]
            starts[robot] = poses[np.arange(NUM_STARTS) % len(poses)]
    raise RangeError(
        f"chain_ranges: no arm of {num_joints} joints out of {_MAX_DRAWS} reaches the reacher's goals; "
        f"reach={ranges.reach} and longest_link={ranges.longest_link} m may be too short"
    )


def sample_chain(ranges: ChainRanges, num_joints: int, rng: np.random.Generator) -> Chain:
    """Draws one arm. Its joints' axes are parallel or at right angles at joint angles 0, the first vertical."""
    quat = np.stack([_sample_turn(i, num_joints, ranges.parallel_share, rng) for i in range(num_joints + 1)])
    pos = _sample_links(ranges, num_joints, rng)
    mass, com, inertia_quat, inertia = _sample_bodies(ranges, pos[1:], rng)
    torque_limit = _sample_torque_limits(ranges, pos, mass, com, rng)
    damping = np.asarray([sample_logarithmic(rng, ranges.damping) for _ in range(num_joints)])
    friction = np.asarray([sample_uniform(rng, ranges.frictionloss) for _ in range(num_joints)])
    friction *= rng.random() < ranges.friction_share
    return Chain(
        pos=pos,
        quat=quat,
        mass=mass,
        com=com,
        inertia_quat=inertia_quat,
        inertia=inertia,
        joint_range=np.stack([_sample_joint_range(ranges, rng) for _ in range(num_joints)]),
        damping=np.minimum(damping, ranges.resistance * torque_limit),
        frictionloss=np.minimum(friction, ranges.resistance * torque_limit),
        armature=np.asarray([sample_logarithmic(rng, ranges.armature) for _ in range(num_joints)]),
        torque_limit=torque_limit,
    )


def _sample_turn(joint: int, num_joints: int, parallel_share: float, rng: np.random.Generator) -> np.ndarray:
    """Rotation [4] from the frame before into that of a joint, or of the tool: quarter turns about z, x, z."""
    about_z, about_own_z = rng.integers(4, size=2) * _TURN
    is_parallel = joint in (0, num_joints) or (joint > 1 and rng.random() < parallel_share)
    about_x = rng.integers(2) * np.pi if is_parallel else _TURN
    half = 0.5 * np.array([about_x, about_z + about_own_z, about_z - about_own_z])
    cosine, sine = np.cos(half), np.sin(half)
    return np.array([cosine[0] * cosine[1], sine[0] * cosine[2], sine[0] * sine[2], cosine[0] * sine[1]])


def _sample_links(ranges: ChainRanges, num_joints: int, rng: np.random.Generator) -> np.ndarray:
    """Positions [n + 1, 3] m of each joint, and of the tool, in the frame before."""
    present = rng.random(num_joints - 1) >= ranges.coincident_share * (num_joints - MIN_JOINTS) / (MAX_JOINTS - MIN_JOINTS)
    share = present * rng.uniform(_SHORTEST, 1.0, num_joints - 1)
    share[-1] += 1e-3  # some link has a length
    length = np.append(share / share.sum() * sample_uniform(rng, ranges.reach), sample_uniform(rng, ranges.tool))
    length = np.minimum(length, ranges.longest_link)
    pos = np.zeros((num_joints + 1, 3))
    pos[0] = [*(sample_uniform(rng, ranges.base_offset) for _ in range(2)), sample_uniform(rng, ranges.base_height)]
    pos[0, :2] *= rng.random() < ranges.offset_share
    for i, metres in enumerate(length, start=1):
        pos[i] = [sample_uniform(rng, ranges.link_offset) for _ in range(3)] * (rng.random(3) < ranges.offset_share)
        pos[i] *= metres > 0
        pos[i, rng.integers(3)] = metres * rng.choice([-1.0, 1.0])
    return pos


def _sample_bodies(ranges: ChainRanges, link: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Mass [n] kg, centre [n, 3] m, principal axes [n, 4] and moments [n, 3] kg m^2 of bodies along `link` [n, 3] m: solid
    cylinders."""
    count = len(link)
    taper = np.linspace(1.0, ranges.last_mass, count) * sample_logarithmic(rng, ranges.mass)
    mass = taper * np.asarray([sample_logarithmic(rng, ranges.mass_ratio) for _ in range(count)])
    along = rng.uniform(0.0, 1.0, (count, 1)) * link
    com = along + np.asarray([[sample_uniform(rng, ranges.com_offset) for _ in range(3)] for _ in range(count)])
    radius = np.asarray([sample_uniform(rng, ranges.radius) for _ in range(count)])
    length = np.maximum(np.linalg.norm(link, axis=1), radius)
    ratio = np.asarray([sample_logarithmic(rng, ranges.inertia_ratio) for _ in range(count)]) * mass
    transverse, axial = ratio * (3 * radius**2 + length**2) / 12, ratio * radius**2 / 2
    inertia_quat = np.stack([_turn_z_to(vector, rng.uniform(0.1, 1.5)) for vector in link])
    return mass, com, inertia_quat, np.stack([transverse, transverse, axial], axis=1)


def _turn_z_to(vector: np.ndarray, roll: float) -> np.ndarray:
    """The rotation [4] that takes z to the direction of `vector`, or leaves it for a zero one, after `roll` [rad] about z."""
    norm = np.linalg.norm(vector)
    x, y, z = vector / norm if norm > 0 else (0.0, 0.0, 1.0)
    quat = np.array([1.0 + z, -y, x, 0.0]) if z > -0.999 else np.array([0.0, 1.0, 0.0, 0.0])
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, quat / np.linalg.norm(quat), np.array([np.cos(roll / 2), 0.0, 0.0, np.sin(roll / 2)]))
    return turned


def _sample_torque_limits(
    ranges: ChainRanges, pos: np.ndarray, mass: np.ndarray, com: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """[n] N m: a multiple of the torque that would hold the arm stretched out level, and no less than the smallest motor."""
    count, length = len(mass), np.linalg.norm(pos, axis=1)
    smallest = sample_logarithmic(rng, ranges.smallest_torque)
    limits = []
    for i in range(count):
        levers = np.cumsum(np.append(0.0, length[i + 1 : count])) + np.linalg.norm(com[i:], axis=1)
        hold = GRAVITY * float(mass[i:] @ levers)
        limits.append(max(hold * sample_logarithmic(rng, ranges.torque_margin), smallest))
    return np.minimum(limits, ranges.largest_torque)


def _sample_joint_range(ranges: ChainRanges, rng: np.random.Generator) -> np.ndarray:
    """[2] rad: of whole turns, about 0, or to one side of it."""
    kind = rng.random()
    if kind < ranges.turning_share:
        return np.array([-1.0, 1.0]) * rng.choice([np.pi, 2 * np.pi])
    if kind < ranges.turning_share + ranges.one_sided_share:
        low = sample_uniform(rng, ranges.one_sided_end)
        bounds = np.array([low, low + sample_uniform(rng, ranges.one_sided_width)])
        return bounds if rng.random() < 0.5 else -bounds[::-1]
    return np.array([-sample_uniform(rng, ranges.joint_range), sample_uniform(rng, ranges.joint_range)])

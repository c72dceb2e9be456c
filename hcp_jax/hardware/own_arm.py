"""Somebody's arm as a pool of one, and how it compares with the arms that a policy was trained on."""

import dataclasses
import itertools

import jax
import numpy as np

from hcp_jax.hardware.arm import TYPES, sample_hardware
from hcp_jax.hardware.arm_encodings import encode_arms
from hcp_jax.hardware.arm_pool import CHAIN_TEMPLATES, make_chain_pool
from hcp_jax.hardware.chain import MAX_JOINTS, Chain
from hcp_jax.hardware.inverse_kinematics import NUM_STARTS, solve_positions
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.hardware.robot_file import RobotFile, RobotFileError
from hcp_jax.hardware.start_poses import GRID

OWN_ID = 9_000_000  # above those of every split
_MAX_ERROR = 0.01  # [m] of a start pose from its point
_START_SPREADS = (0.1, 0.3, 1.0, np.pi)  # [rad] about 0, of the joints that the search for start poses begins at
_LEAST_SPREAD = 0.05  # [m], [rad] of an entry that hardly differs among the training arms
SCALARS = ("torque_limit", "link_mass", "damping", "frictionloss", "armature")


@dataclasses.dataclass(frozen=True)
class Entry:
    """One entry of an arm beside those of the training arms that have that joint: value, lowest and highest, SI units."""

    name: str
    value: float
    low: float
    high: float

    @property
    def is_inside(self) -> bool:
        tolerance = 1e-6 * max(1.0, abs(self.low), abs(self.high))
        return self.low - tolerance <= self.value <= self.high + tolerance


def make_own_pool(task: str, robot: RobotFile) -> RobotPool:
    """A pool of this one arm, standing where the file puts its base.

    Its start poses are those of the training arms: for the reacher the points of `GRID` that it reaches, solved from joints as
    near to 0 as leads there, for peg insertion all joints at 0, or as near as their ranges allow.

    Raises:
        RobotFileError: it reaches no point that the reacher starts from.
    """
    joint_range = robot.chain.padded("joint_range")
    zero = np.clip(np.zeros(MAX_JOINTS), *joint_range.T)
    pool = _make_pool(task, [robot.chain], zero[None])
    if task == "peg_insertion":
        return pool
    points = np.asarray(list(itertools.product(*GRID)))
    repeated, rng = pool.subset(np.zeros(len(points), int)), np.random.default_rng(0)
    distance, angles = np.full(len(points), np.inf), np.zeros((len(points), MAX_JOINTS))
    for spread in _START_SPREADS:
        starts = zero + spread * rng.uniform(-1.0, 1.0, (len(points), NUM_STARTS, MAX_JOINTS))
        solution = solve_positions(repeated, points, jax.random.key(0), starts=np.clip(starts, *joint_range.T))
        better = (distance >= _MAX_ERROR) & (solution.distance < distance)
        distance[better], angles[better] = solution.distance[better], solution.angles[better]
        if (distance < _MAX_ERROR).all():
            break
    reached = distance < _MAX_ERROR
    if not reached.any():
        raise RobotFileError(f"reaches no point that the reacher starts from; it comes within {distance.min():.2f} m of one")
    return _make_pool(task, [robot.chain], angles[reached])


def make_own_variants(task: str, robot: RobotFile, ranges: ArmRanges, count: int, seed: int) -> RobotPool:
    """`count` times this arm, with masses (times `ranges.mass_ratio`) and joint dynamics drawn; its links are as long as they
    are. Raises RobotFileError as `make_own_pool` does."""
    start_angles = make_own_pool(task, robot).hardware["start_angles"][0]
    drawn, chain = sample_hardware(ranges, "I", count, seed), robot.chain
    chains = []
    for row in range(count):
        values = {name: rows[row, : chain.num_joints] for name, rows in drawn.items() if name != "length_change"}
        ratio = values.pop("mass_ratio")
        chains.append(dataclasses.replace(chain, mass=chain.mass * ratio, inertia=chain.inertia * ratio[:, None], **values))
    return _make_pool(task, chains, start_angles)


def _make_pool(task: str, chains: list[Chain], start_angles: np.ndarray) -> RobotPool:
    count = len(chains)
    starts = np.tile(start_angles, (count, 1, 1))
    return make_chain_pool(CHAIN_TEMPLATES[task], chains, OWN_ID + np.arange(count), np.full(count, -1), starts)


def compare_with(own: RobotPool, trained: RobotPool) -> list[Entry]:
    """Every entry of the one arm in `own` beside the range of those in `trained`, joint by joint."""
    entries = []
    for slot in range(int(own.hardware["joint_mask"][0].sum())):
        rows = np.flatnonzero(trained.hardware["joint_mask"][:, slot])
        columns = {name: (own.hardware[name][0, slot], trained.hardware[name][rows, slot]) for name in SCALARS}
        for axis, letter in enumerate("xyz"):
            columns[f"position {letter}"] = (
                own.hardware["chain_pos"][0, slot, axis],
                trained.hardware["chain_pos"][rows, slot, axis],
            )
        for side, word in enumerate(("low", "high")):
            columns[f"range {word}"] = (
                own.hardware["joint_range"][0, slot, side],
                trained.hardware["joint_range"][rows, slot, side],
            )
        entries += [
            Entry(f"joint {slot} {name}", float(value), float(values.min()), float(values.max()))
            for name, (value, values) in columns.items()
        ]
    return entries


def find_nearest(own: RobotPool, trained: RobotPool) -> tuple[str, int, float]:
    """The training arm whose `chain` encoding is nearest: its type, its id, and the root mean square of the differences in
    standard deviations (of at least `_LEAST_SPREAD`)."""
    encoded, reference = encode_arms(own, "chain", trained), encode_arms(trained, "chain", trained)
    scaled = (reference - encoded) / np.maximum(reference.std(axis=0), _LEAST_SPREAD)
    distance = np.sqrt(np.mean(np.square(scaled), axis=1))
    row = int(np.argmin(distance))
    return TYPES[int(trained.hardware["type"][row, 0])], int(trained.robot_id[row]), float(distance[row])

"""Somebody's arm as a pool of one, and how it compares with the arms that a policy was trained on."""

import dataclasses
import itertools

import numpy as np

from hcp_jax.errors import one_line
from hcp_jax.hardware.arm import ALL_TYPES, sample_hardware
from hcp_jax.hardware.arm_encodings import encode_arms
from hcp_jax.hardware.arm_pool import CHAIN_TEMPLATES, make_chain_pool
from hcp_jax.hardware.chain import MAX_JOINTS, Chain
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.hardware.reaching import MAX_ERROR, reach_points
from hcp_jax.hardware.robot_file import RobotFile, RobotFileError
from hcp_jax.hardware.start_poses import GRID

OWN_ID = 9_000_000  # above those of every split
_NUM_SAMPLES, _NUM_STARTS = 4096, 8  # of the search for start poses
_LEAST_SPREAD = 0.05  # [m], [rad] of an entry that hardly differs among the training arms
SCALARS = ("torque_limit", "link_mass", "damping", "frictionloss", "armature")


@dataclasses.dataclass(frozen=True)
class Entry:
    """One entry of an arm beside those of the training arms that have that joint: value, lowest and highest, SI units; None
    where no training arm has it."""

    name: str
    value: float
    low: float | None
    high: float | None

    @property
    def is_inside(self) -> bool:
        if self.low is None or self.high is None:
            return False
        tolerance = 1e-6 * max(1.0, abs(self.low), abs(self.high))
        return self.low - tolerance <= self.value <= self.high + tolerance


def make_own_pool(task: str, robot: RobotFile) -> RobotPool:
    """A pool of this one arm, standing where the file puts its base.

    Its start poses are those of the training arms: for the reacher the points of `GRID` that it reaches, solved from joints as
    near to 0 as leads there, for peg insertion all joints at 0, or as near as their ranges allow.

    Raises:
        RobotFileError: it reaches no point that the reacher starts from.
    """
    if task == "peg_insertion":
        return _make_pool(task, [robot.chain], np.clip(np.zeros((1, MAX_JOINTS)), *robot.chain.padded("joint_range").T))
    points = np.asarray(list(itertools.product(*GRID)))
    angles, distance = reach_points([robot.chain], points[None], seed=0, num_samples=_NUM_SAMPLES, num_starts=_NUM_STARTS)
    reached = distance[0] < MAX_ERROR
    if not reached.any():
        raise RobotFileError(
            f"the arm from {robot.base} to {robot.tip} reaches no point that the reacher starts from; "
            f"it comes within {distance.min():.2f} m of one"
        )
    return _make_pool(task, [robot.chain], angles[0][reached])


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
    """Raises RobotFileError where MuJoCo refuses an arm."""
    count = len(chains)
    starts = np.tile(start_angles, (count, 1, 1))
    try:
        return make_chain_pool(CHAIN_TEMPLATES[task], chains, OWN_ID + np.arange(count), np.full(count, -1), starts)
    except ValueError as error:
        raise RobotFileError(one_line(error)) from error


def compare_with(own: RobotPool, trained: RobotPool) -> list[Entry]:
    """The numbers of the one arm in `own` beside the range of those in `trained`, joint by joint, then the tip's position in
    the last joint's frame. Orientations are left out: their numbers have no ranges."""
    entries = []
    for slot in range(int(own.hardware["joint_mask"][0].sum())):
        rows = np.flatnonzero(trained.hardware["joint_mask"][:, slot])
        columns = {name: (own.hardware[name][0, slot], trained.hardware[name][rows, slot]) for name in SCALARS}
        for axis, letter in enumerate("xyz"):
            columns[f"position {letter}"] = (
                own.hardware["chain_pos"][0, slot, axis],
                trained.hardware["chain_pos"][rows, slot, axis],
            )
            columns[f"centre of mass {letter}"] = (
                own.hardware["link_com"][0, slot, axis],
                trained.hardware["link_com"][rows, slot, axis],
            )
        for side, word in enumerate(("low", "high")):
            columns[f"range {word}"] = (
                own.hardware["joint_range"][0, slot, side],
                trained.hardware["joint_range"][rows, slot, side],
            )
        entries += [
            Entry(
                f"joint {slot} {name}",
                float(value),
                *((float(values.min()), float(values.max())) if len(rows) else (None, None)),
            )
            for name, (value, values) in columns.items()
        ]
    tip, tips = _tip_positions(own)[0], _tip_positions(trained)
    entries += [
        Entry(f"tip position {letter}", float(tip[axis]), float(tips[:, axis].min()), float(tips[:, axis].max()))
        for axis, letter in enumerate("xyz")
    ]
    return entries


def _tip_positions(pool: RobotPool) -> np.ndarray:
    """Each arm's tip in the frame of its last joint [m]: [N, 3]."""
    num_joints = pool.hardware["joint_mask"].sum(axis=1).astype(int)
    return pool.hardware["chain_pos"][np.arange(pool.num_robots), num_joints]


def find_nearest(own: RobotPool, trained: RobotPool) -> tuple[str, int, float]:
    """The training arm whose `chain` encoding is nearest: its type, its id, and the root mean square of the differences in
    standard deviations (of at least `_LEAST_SPREAD`)."""
    encoded, reference = encode_arms(own, "chain", trained), encode_arms(trained, "chain", trained)
    scaled = (reference - encoded) / np.maximum(reference.std(axis=0), _LEAST_SPREAD)
    distance = np.sqrt(np.mean(np.square(scaled), axis=1))
    row = int(np.argmin(distance))
    return ALL_TYPES[int(trained.hardware["type"][row, 0])], int(trained.robot_id[row]), float(distance[row])

"""Ranges of robot parameters, and the paper's rule for drawing from them."""

import dataclasses

import numpy as np

from hcp_jax.errors import UserError

Range = tuple[float, float]

# Purposes of random draws, and the distance between their robot ids: held-out robots never depend on how many training
# robots there are, and robot 1_000_003 is held-out robot 3 of its seed.
SPLITS = {"train": 0, "heldout": 1, "new": 2}
SPLIT_STRIDE = 1_000_000
TYPE_STRIDE = 10_000  # between robot ids of two types of arms


# [m] of the nominal arm (arm.json): where a link's change of length puts the next body. A link that more is taken off turns
# round.
LINK_LENGTHS = {
    "l0": 0.237,
    "l1_1": 0.1336,
    "l1_2": 0.14,
    "l2": 0.263,
    "l3_1": 0.1265,
    "l3_2": 0.1265,
    "l4": 0.275,
    "l5_1": 0.0958,
    "l5_2": 0.076,
    "l6": 0.0488,
}


class RangeError(UserError):
    """A range is empty, reversed or outside what physics allows."""


def check_range(name: str, bounds: Range, minimum: float = 0.0) -> None:
    """Raises RangeError unless `minimum <= low <= high` and both are finite."""
    if len(bounds) != 2 or not all(np.isfinite(bounds)):
        raise RangeError(f"{name}={bounds}: expected two finite numbers (low, high)")
    low, high = bounds
    if low < minimum:
        raise RangeError(f"{name}={bounds}: must not be below {minimum:g}")
    if low > high:
        raise RangeError(f"{name}={bounds}: low is above high")


def sample_uniform(rng: np.random.Generator, bounds: Range) -> float:
    """Draws uniformly from `bounds`; a zero-width range returns its value exactly."""
    low, high = bounds
    return low if low == high else float(rng.uniform(low, high))


def sample_half_below_one(rng: np.random.Generator, bounds: Range) -> float:
    """Draws below 1 with probability one half and above 1 otherwise, each part uniform (hopper.json, arm.json).

    A range that does not contain 1 in its interior is sampled uniformly.
    """
    low, high = bounds
    if not low < 1.0 < high:
        return sample_uniform(rng, bounds)
    return float(rng.uniform(low, 1.0)) if rng.random() < 0.5 else float(rng.uniform(1.0, high))


@dataclasses.dataclass(frozen=True)
class HopperRanges:
    """Ranges of the hopper pool (paper, appendix, table "Hopper Parameters").

    Lengths are in metres and uniform; friction loss [N m] is uniform; damping [N m s/rad], armature [kg m^2] and mass
    ratios (relative to density 1000 kg/m^3 at the sampled length) are below 1 for half of the draws and above for half.
    """

    torso_length: Range = (0.30, 0.50)
    thigh_length: Range = (0.35, 0.55)
    leg_length: Range = (0.35, 0.65)
    foot_length: Range = (0.29, 0.49)
    torso_mass_ratio: Range = (0.25, 2.0)
    thigh_mass_ratio: Range = (0.25, 2.0)
    leg_mass_ratio: Range = (0.25, 2.0)
    foot_mass_ratio: Range = (0.25, 2.0)
    damping: Range = (0.01, 5.0)
    frictionloss: Range = (0.0, 2.0)
    armature: Range = (0.1, 2.0)

    def __post_init__(self):
        for field in dataclasses.fields(self):
            positive = field.name.endswith(("_length", "_mass_ratio"))
            check_range(f"ranges.{field.name}", getattr(self, field.name), minimum=1e-3 if positive else 0.0)


def sample_logarithmic(rng: np.random.Generator, bounds: Range) -> float:
    """Draws from `bounds`, above 0, uniformly in the logarithm."""
    return float(np.exp(sample_uniform(rng, (np.log(bounds[0]), np.log(bounds[1])))))


@dataclasses.dataclass(frozen=True)
class ArmRanges:
    """Ranges of the arm pool (paper, appendix, table "Manipulator Parameters").

    Links `l0` to `l6` are changes of length [m] from the nominal arm. Friction loss [N m] is uniform; damping [N m s/rad],
    armature [kg m^2] and mass ratios (of the nominal arm's bodies) are below 1 for half of the draws and above for half.
    """

    l0: Range = (-0.10, 0.10)
    l1_1: Range = (-0.05, 0.05)
    l1_2: Range = (-0.07, 0.07)
    l2: Range = (-0.12, 0.12)
    l3_1: Range = (-0.06, 0.06)
    l3_2: Range = (-0.06, 0.06)
    l4: Range = (-0.12, 0.12)
    l5_1: Range = (-0.04, 0.04)
    l5_2: Range = (-0.03, 0.03)
    l6: Range = (-0.02, 0.02)
    mass_ratio: Range = (0.25, 4.0)
    damping: Range = (0.01, 30.0)
    frictionloss: Range = (0.0, 10.0)
    armature: Range = (0.01, 4.0)

    def __post_init__(self):
        for field in dataclasses.fields(self):
            minimum = -LINK_LENGTHS[field.name] if field.name in LINK_LENGTHS else 1e-3 if field.name == "mass_ratio" else 0.0
            check_range(f"ranges.{field.name}", getattr(self, field.name), minimum)


# Of the entries of `ChainRanges` that may be 0 or below; the others are logarithmic, or a size.
_LEAST = {
    "tool": 0.0,
    "frictionloss": 0.0,
    "link_offset": -1.0,
    "base_height": -1.0,
    "base_offset": -1.0,
    "com_offset": -1.0,
    "one_sided_end": -1.0,
}


@dataclasses.dataclass(frozen=True)
class ChainRanges:
    """Ranges of random chains. Chosen to enclose every entry of every arm in `robots/catalogue/` (a test compares them).

    Attributes:
        parallel_share: of the joints from the third on, whose axis is parallel to the one before (UR arms); others are at right
            angles to it.
        reach: lengths of the links between first and last joint together [m].
        coincident_share: of the links without length (spherical shoulders and wrists).
        longest_link: [m].
        tool: from the last joint to the point of interest [m].
        link_offset: a joint's offset [m] beside its link, in each of two directions, where it has one.
        base_height, base_offset: of the first joint [m], upwards and in each horizontal direction, where it has one.
        offset_share: of the offsets that are not 0.
        mass: [kg] of a first link; the last weighs `last_mass` of it, those between are in line.
        mass_ratio: factor on each link's mass.
        last_mass: see `mass`.
        com_offset: a centre of mass beside its link [m], in each direction.
        radius: of the cylinders whose inertias links have [m], times `inertia_ratio`.
        inertia_ratio: see `radius`.
        torque_margin: torque limits as multiples of what holds the arm stretched out level.
        smallest_torque: no motor of an arm is weaker [N m].
        largest_torque: nor stronger [N m].
        damping: [N m s/rad], drawn in the logarithm like masses, torques and armatures.
        frictionloss: [N m] of the `friction_share` of arms that have any.
        friction_share: see `frictionloss`.
        resistance: friction loss, and damping at 1 rad/s, are at most this share of a joint's torque limit.
        armature: [kg m^2].
        joint_range: how far joints turn to each side [rad]. `turning_share` of the joints turn by pi or 2 pi to both, and
            `one_sided_share` from `one_sided_end` over `one_sided_width` or the mirror image of that (elbows).
        turning_share, one_sided_share, one_sided_end, one_sided_width: see `joint_range`.
    """

    parallel_share: float = 0.25
    reach: Range = (0.65, 1.35)
    coincident_share: float = 0.25
    longest_link: float = 0.65
    tool: Range = (0.0, 0.2)
    link_offset: Range = (-0.18, 0.18)
    base_height: Range = (0.05, 0.4)
    base_offset: Range = (-0.13, 0.13)
    offset_share: float = 0.4
    mass: Range = (0.8, 10.0)
    mass_ratio: Range = (0.4, 2.0)
    last_mass: float = 0.25
    com_offset: Range = (-0.05, 0.05)
    radius: Range = (0.03, 0.08)
    inertia_ratio: Range = (0.5, 2.5)
    torque_margin: Range = (1.0, 6.0)
    smallest_torque: Range = (7.0, 60.0)
    largest_torque: float = 350.0
    damping: Range = (0.3, 15.0)
    frictionloss: Range = (0.0, 6.0)
    friction_share: float = 0.5
    resistance: float = 0.7
    armature: Range = (0.08, 0.5)
    joint_range: Range = (1.2, 5.0)
    turning_share: float = 0.3
    one_sided_share: float = 0.2
    one_sided_end: Range = (-0.3, 0.3)
    one_sided_width: Range = (2.5, 4.5)

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if name.endswith("_share"):
                if not 0.0 <= value <= 1.0:
                    raise RangeError(f"chain_ranges.{name}={value}: expected a number in [0, 1]")
            elif not isinstance(value, tuple):
                check_range(f"chain_ranges.{name}", (value, value), minimum=1e-3)
            else:
                check_range(f"chain_ranges.{name}", value, _LEAST.get(name, 1e-3))
        if self.turning_share + self.one_sided_share > 1.0:
            raise RangeError(f"chain_ranges.one_sided_share={self.one_sided_share}: above 1 with turning_share")


def nominal_lengths(ranges: ArmRanges) -> ArmRanges:
    """`ranges` for arms that differ in dynamics alone (paper, appendix, "Effect of Dynamics")."""
    return dataclasses.replace(ranges, **dict.fromkeys(LINK_LENGTHS, (0.0, 0.0)))


def torso_mass_only() -> HopperRanges:
    """Ranges of the embedding experiment: nominal hoppers that differ in torso mass alone (paper, section 5.2)."""
    return HopperRanges(
        torso_length=(0.40, 0.40),
        thigh_length=(0.45, 0.45),
        leg_length=(0.50, 0.50),
        foot_length=(0.39, 0.39),
        thigh_mass_ratio=(1.0, 1.0),
        leg_mass_ratio=(1.0, 1.0),
        foot_mass_ratio=(1.0, 1.0),
        damping=(1.0, 1.0),
        frictionloss=(0.0, 0.0),
        armature=(1.0, 1.0),
    )

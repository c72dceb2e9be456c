"""Ranges of robot parameters, and the paper's rule for drawing from them."""

import dataclasses

import numpy as np

from hcp_jax.errors import UserError

Range = tuple[float, float]

# Purposes of random draws, and the distance between their robot ids: held-out robots never depend on how many training
# robots there are, and robot 1_000_003 is held-out robot 3 of its seed.
SPLITS = {"train": 0, "heldout": 1, "new": 2}
SPLIT_STRIDE = 1_000_000


# [m] Every link of the nominal arm is longer than this: a link may shrink but not turn round.
SHORTEST_LINK_CHANGE = -0.25


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
            minimum = SHORTEST_LINK_CHANGE if field.name.startswith("l") else 1e-3 if field.name == "mass_ratio" else 0.0
            check_range(f"ranges.{field.name}", getattr(self, field.name), minimum)


def nominal_lengths(ranges: ArmRanges) -> ArmRanges:
    """`ranges` for arms that differ in dynamics alone (paper, appendix, "Effect of Dynamics")."""
    links = [field.name for field in dataclasses.fields(ranges) if field.name.startswith("l")]
    return dataclasses.replace(ranges, **dict.fromkeys(links, (0.0, 0.0)))


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

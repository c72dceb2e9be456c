"""The arm's variants: types made by removing joints, and drawn hardware (paper, section 4.1 and appendix)."""

import dataclasses

import mujoco
import numpy as np

from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.ranges import SPLITS, ArmRanges, sample_half_below_one, sample_uniform

JOINTS = ("j0", "j1", "j2", "j3", "j4", "j5", "j6")
BODIES = ("l0", "l1", "l2", "l3", "l4", "l5", "l6")
# Joints that each type lacks (arm.json). J is another arm, without sideways offsets; K is that of the Fetch robot.
REMOVED_JOINTS = {
    "A": ("j2", "j4"),
    "B": ("j2", "j6"),
    "C": ("j4", "j6"),
    "D": ("j4", "j5"),
    "E": ("j2",),
    "F": ("j1",),
    "G": ("j4",),
    "H": ("j5",),
    "I": (),
    "J": ("j2", "j4"),
    "K": (),
}
TYPES = tuple(REMOVED_JOINTS)
# Types that are drawn joint by joint (`hcp_jax.hardware.random_chain`): how many joints each has. For the reacher.
CHAIN_TYPES = {"R4": 4, "R5": 5, "R6": 6, "R7": 7}
ALL_TYPES = (*TYPES, *CHAIN_TYPES)  # in the order of a pool's type numbers
OWN_TYPE = "own"  # an arm from a file: type number -1
ARM_TEMPLATES = {"reacher": "arm_reacher.xml", "peg_insertion": "arm_peg.xml"}
# Types of another template, which hold a peg: of peg insertion alone.
OTHER_ARMS = {"J": "arm_straight_peg.xml", "K": "arm_fetch_peg.xml"}


@dataclasses.dataclass(frozen=True)
class LinkEffect:
    """A link's growth moves `child` along `axis` of its own position, away from 0; `geom` spans it."""

    child: str
    axis: int
    geom: str


# What a link's length moves (arm.json, link_length_effect).
LINK_EFFECTS = {
    "l0": LinkEffect("l1", 2, "gl0"),
    "l1_1": LinkEffect("l2", 2, "gl1_1"),
    "l1_2": LinkEffect("l2", 1, "gl1_2"),
    "l2": LinkEffect("l3", 2, "gl2"),
    "l3_1": LinkEffect("l4", 2, "gl3_1"),
    "l3_2": LinkEffect("l4", 1, "gl3_2"),
    "l4": LinkEffect("l5", 2, "gl4"),
    "l5_1": LinkEffect("l6", 2, "gl5_1"),
    "l5_2": LinkEffect("l6", 1, "gl5_2"),
    "l6": LinkEffect("connector_plate_base", 2, "gl6"),
}
LINKS = tuple(LINK_EFFECTS)

Hardware = dict[str, np.ndarray]


def type_name(number: float) -> str:
    """The type that a pool's hardware `type` stands for."""
    return OWN_TYPE if number < 0 else ALL_TYPES[int(number)]


def sample_hardware(ranges: ArmRanges, robot_type: str, num_robots: int, seed: int, split: str = "train") -> Hardware:
    """Draws the hardware of robots 0..num_robots-1 of a type; robot i is the same whatever `num_robots` is.

    Returns:
        length_change [N, 10] in m in the order of `LINKS`, mass_ratio [N, 7] of `BODIES`, and damping, frictionloss, armature
        [N, 7] of `JOINTS`, also for joints that the type lacks.
    """
    rows: dict[str, list] = {name: [] for name in ("length_change", "mass_ratio", "damping", "frictionloss", "armature")}
    for robot in range(num_robots):
        rng = np.random.default_rng([seed, SPLITS[split], TYPES.index(robot_type), robot])
        rows["length_change"].append([sample_uniform(rng, getattr(ranges, link)) for link in LINKS])
        rows["mass_ratio"].append([sample_half_below_one(rng, ranges.mass_ratio) for _ in BODIES])
        rows["damping"].append([sample_half_below_one(rng, ranges.damping) for _ in JOINTS])
        rows["frictionloss"].append([sample_uniform(rng, ranges.frictionloss) for _ in JOINTS])
        rows["armature"].append([sample_half_below_one(rng, ranges.armature) for _ in JOINTS])
    return {name: np.asarray(values, np.float64) for name, values in rows.items()}


def arm_spec(task: str, robot_type: str, hardware: Hardware | None = None) -> mujoco.MjSpec:
    """One arm with its own joints, nominal or with `hardware`, rows of `sample_hardware`."""
    name = OTHER_ARMS.get(robot_type, ARM_TEMPLATES[task])
    spec = mujoco.MjSpec.from_file(str(robots_path() / name))
    if hardware is not None:
        if robot_type != "K":  # one robot that exists: its links are as long as they are
            change_lengths(spec, hardware["length_change"])
        change_dynamics(spec, hardware)
    for joint in REMOVED_JOINTS[robot_type]:
        if spec.joint(joint) is not None:
            spec.delete(spec.actuator(joint))
            spec.delete(spec.joint(joint))
    return spec


def change_lengths(spec: mujoco.MjSpec, length_change: np.ndarray) -> None:
    """Lengthens the links of an arm's spec by `length_change` [10] m; their inertias stay (arm.json)."""
    for change, effect in zip(length_change, LINK_EFFECTS.values(), strict=True):
        body = spec.body(effect.child)
        position = np.array(body.pos)
        # A link grows away from 0; the offset-free arm has links of no length, which stay so.
        shift = float(change) * np.sign(position[effect.axis])
        position[effect.axis] += shift
        body.pos = position
        grow_geom(spec, effect, shift)


def change_dynamics(spec: mujoco.MjSpec, hardware: Hardware) -> None:
    """Writes masses and joint dynamics into an arm's spec. Inertias scale with the mass ratio (arm.json)."""
    for ratio, name in zip(hardware["mass_ratio"], BODIES, strict=True):
        body = spec.body(name)
        body.mass *= float(ratio)
        body.inertia = np.array(body.inertia) * float(ratio)
    for i, name in enumerate(JOINTS):
        joint = spec.joint(name)
        if joint is not None:
            joint.damping = [float(hardware["damping"][i]), 0, 0]
            joint.frictionloss = float(hardware["frictionloss"][i])
            joint.armature = float(hardware["armature"][i])


def grow_geom(spec: mujoco.MjSpec, effect: LinkEffect, shift: float) -> None:
    """Lengthens a link's geom with it: for pictures, nothing collides with these."""
    geom = spec.geom(effect.geom)
    if geom is not None:
        size, position = np.array(geom.size), np.array(geom.pos)
        size[1] = max(size[1] + abs(shift) / 2 * np.sign(shift * (position[effect.axis] or 1.0)), 1e-3)
        position[effect.axis] += shift / 2
        geom.size, geom.pos = size, position

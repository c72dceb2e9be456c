"""The hopper's variants: drawing their hardware, and compiling a MuJoCo model of each from the template."""

from collections.abc import Iterator, Mapping

import mujoco
import numpy as np

from hcp_jax.hardware.pool import RobotPool, robots_path, stack_models
from hcp_jax.hardware.ranges import SPLIT_STRIDE, SPLITS, HopperRanges, sample_half_below_one, sample_uniform

TEMPLATE = "hopper.xml"
LINKS = ("torso", "thigh", "leg", "foot")
JOINTS = ("thigh_joint", "leg_joint", "foot_joint")
DENSITY = 1000.0  # [kg/m^3], at mass ratio 1
ANKLE_HEIGHT = 0.1  # [m] of the foot's axis above the floor in the initial stand
HEEL_SHARE = 1.0 / 3.0  # the foot reaches a third of its length behind the ankle

Hardware = dict[str, np.ndarray]


def sample_hardware(ranges: HopperRanges, num_robots: int, seed: int, split: str = "train") -> Hardware:
    """Draws the hardware of robots 0..num_robots-1; robot i is the same whatever `num_robots` is.

    Returns:
        link_length [N, 4] in m, mass_ratio [N, 4], damping [N, 3], frictionloss [N, 3], armature [N, 3], in the order
        of `LINKS` and `JOINTS`.
    """
    rows: dict[str, list] = {name: [] for name in ("link_length", "mass_ratio", "damping", "frictionloss", "armature")}
    for robot in range(num_robots):
        rng = np.random.default_rng([seed, SPLITS[split], robot])
        rows["link_length"].append([sample_uniform(rng, getattr(ranges, f"{link}_length")) for link in LINKS])
        rows["mass_ratio"].append([sample_half_below_one(rng, getattr(ranges, f"{link}_mass_ratio")) for link in LINKS])
        rows["damping"].append([sample_half_below_one(rng, ranges.damping) for _ in JOINTS])
        rows["frictionloss"].append([sample_uniform(rng, ranges.frictionloss) for _ in JOINTS])
        rows["armature"].append([sample_half_below_one(rng, ranges.armature) for _ in JOINTS])
    return {name: np.asarray(values, np.float64) for name, values in rows.items()}


def edit_spec(spec: mujoco.MjSpec, hardware: Mapping[str, np.ndarray]) -> None:
    """Writes one robot's hardware (rows of `sample_hardware`) into the template's spec.

    The ankle stays `ANKLE_HEIGHT` above the floor, so that longer hoppers stand taller; `qpos[1]` starts at the slide's
    `ref` of 1.25 for every hopper whatever its length (hopper.json).
    """
    torso, thigh, leg, foot = (float(length) for length in hardware["link_length"])
    spec.body("torso").pos = [0, 0, ANKLE_HEIGHT + leg + thigh + torso / 2]
    spec.body("thigh").pos = [0, 0, -torso / 2]
    spec.body("leg").pos = [0, 0, -thigh]
    spec.body("foot").pos = [0, 0, -leg]
    spec.geom("torso").fromto = [0, 0, torso / 2, 0, 0, -torso / 2]
    spec.geom("thigh").fromto = [0, 0, 0, 0, 0, -thigh]
    spec.geom("leg").fromto = [0, 0, 0, 0, 0, -leg]
    spec.geom("foot").fromto = [-foot * HEEL_SHARE, 0, 0, foot * (1 - HEEL_SHARE), 0, 0]
    for i, link in enumerate(LINKS):
        spec.geom(link).density = DENSITY * float(hardware["mass_ratio"][i])
    for i, name in enumerate(JOINTS):
        joint = spec.joint(name)
        joint.damping = [float(hardware["damping"][i]), 0, 0]
        joint.frictionloss = float(hardware["frictionloss"][i])
        joint.armature = float(hardware["armature"][i])


def compile_models(hardware: Hardware) -> Iterator[mujoco.MjModel]:
    """Compiles one MjModel per robot (about 0.5 ms each), so that every derived constant is MuJoCo's own."""
    spec = mujoco.MjSpec.from_file(str(robots_path() / TEMPLATE))
    for robot in range(len(hardware["link_length"])):
        edit_spec(spec, {name: values[robot] for name, values in hardware.items()})
        yield spec.compile()


def make_hopper_pool(ranges: HopperRanges, num_robots: int, seed: int, split: str = "train") -> RobotPool:
    """Samples, compiles and stacks a pool of hoppers."""
    hardware = sample_hardware(ranges, num_robots, seed, split)
    template = (robots_path() / TEMPLATE).read_text()
    links = [mujoco.MjModel.from_xml_string(template).body(link).id for link in LINKS]
    fields = stack_models(compile_models(hardware))
    hardware["body_mass"] = fields["body_mass"][:, links]
    return RobotPool(
        template=template,
        fields=fields,
        hardware=hardware,
        robot_id=np.arange(num_robots, dtype=np.int32) + SPLITS[split] * SPLIT_STRIDE,
    )

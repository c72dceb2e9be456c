"""Pools of arms: every variant as a padded chain, stacked.

An arm is edited and compiled as MuJoCo sees it (`arm_reacher.xml`, `arm_peg.xml`), read as a chain, and compiled again in the
template that all arms share. So composite inertias are MuJoCo's own, and every type stands in the same pool.
"""

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from hcp_jax.hardware.arm import ALL_TYPES, CHAIN_TYPES, arm_spec, sample_hardware
from hcp_jax.hardware.chain import MAX_JOINTS, Chain, edit_spec, read_chain
from hcp_jax.hardware.pool import PoolError, RobotPool, repeat_poses, robots_path, stack_models
from hcp_jax.hardware.random_chain import sample_reaching_chains
from hcp_jax.hardware.ranges import SPLIT_STRIDE, SPLITS, TYPE_STRIDE, ArmRanges, ChainRanges
from hcp_jax.hardware.start_poses import start_angles

CHAIN_TEMPLATES = {"reacher": "chain_reacher.xml", "peg_insertion": "chain_peg.xml"}
# What a pool's `hardware` has of a chain under the same name.
_HARDWARE = ("joint_range", "torque_limit", "damping", "frictionloss", "armature")


def make_arm_pool(
    task: str,
    ranges: ArmRanges,
    types: Sequence[str],
    num_per_type: int,
    seed: int,
    split: str = "train",
    chain_ranges: ChainRanges | None = None,
) -> RobotPool:
    """Samples, compiles and stacks `num_per_type` arms of each of `types`, in that order: random chains from `chain_ranges` (by
    default `ChainRanges()`), the others from `ranges`.

    Raises:
        PoolError: more robots of a type than there are ids.
    """
    if num_per_type > TYPE_STRIDE:
        raise PoolError(f"{num_per_type:,} arms of each type: expected at most {TYPE_STRIDE:,}, or two would share an id")
    chains, ids, numbers, starts = [], [], [], []
    for robot_type in types:
        number = ALL_TYPES.index(robot_type)
        if robot_type in CHAIN_TYPES:
            seeds = [seed, SPLITS[split], number]
            drawn, angles = sample_reaching_chains(chain_ranges or ChainRanges(), CHAIN_TYPES[robot_type], num_per_type, seeds)
            chains += drawn
        else:
            chains += sample_arms(task, ranges, robot_type, num_per_type, seed, split)
            angles = np.tile(start_angles(task, robot_type), (num_per_type, 1, 1))
        ids.append(SPLITS[split] * SPLIT_STRIDE + number * TYPE_STRIDE + np.arange(num_per_type))
        numbers += [number] * num_per_type
        starts.append(angles)
    most = max(angles.shape[1] for angles in starts)
    starts = [repeat_poses(angles, most) for angles in starts]
    return make_chain_pool(CHAIN_TEMPLATES[task], chains, np.concatenate(ids), np.asarray(numbers), np.concatenate(starts))


def sample_arms(task: str, ranges: ArmRanges, robot_type: str, count: int, seed: int, split: str) -> list[Chain]:
    """Variants 0 to count - 1 of one of the paper's types."""
    hardware = sample_hardware(ranges, robot_type, count, seed, split)
    variants = [{name: values[robot] for name, values in hardware.items()} for robot in range(count)]
    return [read_chain(arm_spec(task, robot_type, variant).compile()) for variant in variants]


def make_chain_pool(
    template: str, chains: Sequence[Chain], robot_id: np.ndarray, robot_type: np.ndarray, start_angles: np.ndarray
) -> RobotPool:
    """Compiles chains in their common template and stacks them.

    Its `hardware` has, with zeros for missing joints: chain_pos [N, 8, 3] m and chain_quat [N, 8, 4], the frame of each joint
    in that of the one before, then of the point of interest in the last joint's; joint_mask [N, 7]; joint_range [N, 7, 2] rad;
    torque_limit [N, 7] N m; link_mass [N, 7] kg and link_com [N, 7, 3] m, its centre in the joint's frame; damping,
    frictionloss, armature [N, 7]; type [N, 1], a position in `ALL_TYPES`; start_angles [N, S, 7] rad, as given.
    """
    hardware = {name: np.stack([chain.padded(name) for chain in chains]) for name in _HARDWARE}
    hardware |= {
        "chain_pos": np.stack([chain.padded("pos") for chain in chains]),
        "chain_quat": np.stack([chain.padded("quat") for chain in chains]),
        "joint_mask": np.asarray([np.arange(MAX_JOINTS) < chain.num_joints for chain in chains], np.float64),
        "link_com": np.stack([chain.padded("com") for chain in chains]),
        "link_mass": np.stack([chain.padded("mass") for chain in chains]),
        "type": np.asarray(robot_type, np.float64)[:, None],
        "start_angles": np.asarray(start_angles, np.float64),
    }
    return RobotPool(
        template=(robots_path() / template).read_text(),
        fields=stack_models(compile_chains(template, chains)),
        hardware=hardware,
        robot_id=np.asarray(robot_id, np.int32),
    )


def compile_chains(template: str, chains: Sequence[Chain]) -> Iterator[mujoco.MjModel]:
    """One MjModel per chain, in a template of `robots/`."""
    spec = mujoco.MjSpec.from_file(str(robots_path() / template))
    for chain in chains:
        edit_spec(spec, chain)
        yield spec.compile()


def read_pooled_chain(pool: RobotPool, row: int) -> Chain:
    """The chain that robot `row` of a pool was made from, without its padding."""
    count = int(pool.hardware["joint_mask"][row].sum())
    slots = slice(1, count + 1)  # body 0 is the world
    fields = {"mass": "body_mass", "com": "body_ipos", "inertia_quat": "body_iquat", "inertia": "body_inertia"}
    hardware = {name: pool.hardware[name][row, :count] for name in _HARDWARE}
    return Chain(
        pos=pool.hardware["chain_pos"][row, : count + 1],
        quat=pool.hardware["chain_quat"][row, : count + 1],
        **{name: pool.fields[field][row, slots] for name, field in fields.items()},
        **hardware,
    )

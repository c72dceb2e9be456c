import itertools

import mujoco
import numpy as np
import pytest

from hcp_jax.hardware import random_chain
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.catalogue import catalogue_names, load_robot
from hcp_jax.hardware.chain import GRAVITY, Chain
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.random_chain import sample_chain, sample_reaching_chains
from hcp_jax.hardware.ranges import ArmRanges, ChainRanges, RangeError
from hcp_jax.hardware.reaching import MAX_ERROR, reach_points
from hcp_jax.hardware.start_poses import GRID, REACHER_GOALS

COLUMNS = ("mass", "torque_limit", "damping", "frictionloss", "armature", "joint_range", "pos", "com")


@pytest.fixture(scope="module")
def drawn() -> list[Chain]:
    rng = np.random.default_rng(0)
    return [sample_chain(ChainRanges(), num_joints, rng) for num_joints in (6, 7) for _ in range(400)]


@pytest.fixture(scope="module")
def chains() -> RobotPool:
    return make_arm_pool("reacher", ArmRanges(), ("R5", "R7"), 2, seed=3)


def outside(arm: Chain, drawn: list[Chain]) -> list[str]:
    """Entries of `arm` that are beyond those of all of `drawn`, joint by joint."""
    names = []
    for column, slot in itertools.product(COLUMNS, range(arm.num_joints)):
        others = np.stack([getattr(chain, column)[slot] for chain in drawn if chain.num_joints > slot])
        value = getattr(arm, column)[slot]
        if ((value < others.min(axis=0) - 1e-9) | (value > others.max(axis=0) + 1e-9)).any():
            names.append(f"joint {slot} {column}")
    return names


@pytest.mark.parametrize("name", catalogue_names())
def test_every_entry_of_every_catalogue_arm_is_inside_what_is_drawn(name, drawn):
    assert outside(load_robot(name).chain, drawn) == []


def test_an_arm_beyond_the_ranges_is_seen_to_be_outside(drawn):
    chain = load_robot("gen3").chain
    chain.mass[2] = 50.0
    assert outside(chain, drawn) == ["joint 2 mass"]


def test_no_arm_of_the_catalogue_is_drawn(drawn):
    for name in catalogue_names():
        arm = load_robot(name).chain
        others = [chain for chain in drawn if chain.num_joints == arm.num_joints]
        assert min(np.abs(chain.pos - arm.pos).max() for chain in others) > 0.01


def test_an_arm_is_the_same_however_many_are_drawn(chains):
    few, starts = sample_reaching_chains(ChainRanges(), 7, 1, [3, 0, 14])
    np.testing.assert_array_equal(few[0].pos, chains.hardware["chain_pos"][2])
    np.testing.assert_array_equal(starts[0], chains.hardware["start_angles"][2])


def test_start_poses_are_at_points_of_the_grid_within_joint_limits(chains):
    grid = np.asarray(list(itertools.product(*GRID)))
    for row, model in enumerate(chains.models()):
        data = mujoco.MjData(model)
        low, high = np.moveaxis(chains.hardware["joint_range"][row], -1, 0)
        for angles in chains.hardware["start_angles"][row]:
            data.qpos[:] = angles
            mujoco.mj_kinematics(model, data)
            assert np.linalg.norm(grid - data.site("ref_pt").xpos, axis=1).min() < MAX_ERROR + 1e-4
            assert ((angles >= low) & (angles <= high)).all()


def test_arms_reach_the_corners_of_the_goals():
    arms, _ = sample_reaching_chains(ChainRanges(), 6, 2, [0, 0, 13])
    corners = np.asarray(list(itertools.product(*zip(*REACHER_GOALS, strict=True))))
    assert (reach_points(arms, np.tile(corners, (2, 1, 1)), 1, num_samples=2048, num_starts=8)[1] < MAX_ERROR).all()


def test_ranges_that_no_arm_reaches_the_goals_with_are_refused(monkeypatch):
    monkeypatch.setattr(random_chain, "_MAX_DRAWS", 5)
    with pytest.raises(RangeError, match="no arm of 6 joints out of 5 reaches the reacher's goals"):
        sample_reaching_chains(ChainRanges(reach=(0.05, 0.1)), 6, 2, (0,))


def test_of_two_ways_to_a_point_the_one_nearer_to_zero_is_taken():
    arm = load_robot("ur5e").chain  # its joints turn by 2 pi
    angles, distance = reach_points([arm], np.array([[[0.4, 0.1, 0.6]]]), 0, num_samples=2048, num_starts=8)
    any_start, _ = reach_points([arm], np.array([[[0.4, 0.1, 0.6]]]), 0, num_samples=2048, num_starts=1)
    assert distance[0, 0] < MAX_ERROR
    assert np.linalg.norm(angles) <= np.linalg.norm(any_start)
    assert np.abs(angles).max() < np.pi


def test_motors_hold_the_arm_in_any_pose_unless_they_are_as_strong_as_motors_get(chains, rng):
    strongest = ChainRanges().largest_torque
    for row, model in enumerate(chains.models()):
        assert model.opt.gravity[2] == pytest.approx(-GRAVITY)
        limit, data = chains.hardware["torque_limit"][row], mujoco.MjData(model)
        for _ in range(20):
            data.qpos[:] = rng.uniform(-np.pi, np.pi, model.nq) * chains.hardware["joint_mask"][row]
            mujoco.mj_forward(model, data)
            assert (np.abs(data.qfrc_bias) <= limit + 1e-6)[limit < strongest].all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reach": (1.0, 0.5)}, "chain_ranges.reach=.1.0, 0.5.: low is above high"),
        ({"damping": (0.0, 1.0)}, "chain_ranges.damping=.0.0, 1.0.: must not be below 0.001"),
        ({"parallel_share": 1.5}, "chain_ranges.parallel_share=1.5: expected a number in .0, 1."),
        ({"turning_share": 0.9}, "chain_ranges.one_sided_share=0.2: above 1 with turning_share"),
    ],
)
def test_bad_ranges_are_refused_in_one_line(change, message):
    with pytest.raises(RangeError, match=message):
        ChainRanges(**change)

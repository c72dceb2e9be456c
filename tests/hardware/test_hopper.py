import dataclasses
import time

import mujoco
import numpy as np
import pytest

from hcp_jax.hardware.hopper import compile_models, make_hopper_pool, sample_hardware
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.ranges import HopperRanges, torso_mass_only


def nominal_ranges() -> HopperRanges:
    return dataclasses.replace(torso_mass_only(), torso_mass_ratio=(1.0, 1.0))


def test_zero_width_ranges_leave_the_template_unchanged():
    template = mujoco.MjModel.from_xml_path(str(robots_path() / "hopper.xml"))
    model = next(compile_models(sample_hardware(nominal_ranges(), 1, seed=0)))
    for name in ("body_pos", "body_mass", "body_inertia", "geom_size", "dof_damping", "dof_armature", "dof_invweight0"):
        np.testing.assert_allclose(getattr(model, name), getattr(template, name), rtol=1e-12, atol=1e-12)


def test_every_hopper_stands_at_height_one_and_a_quarter_with_its_ankle_a_tenth_above_the_floor(pool):
    for robot, model in enumerate(pool.models()[:8]):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        torso, thigh, leg, _ = pool.hardware["link_length"][robot]
        assert data.qpos[1] == 1.25
        assert data.body("foot").xpos[2] == pytest.approx(0.1)
        assert data.body("torso").xpos[2] == pytest.approx(0.1 + leg + thigh + torso / 2)


def test_link_lengths_are_the_distances_between_joints(pool):
    for robot, model in enumerate(pool.models()[:8]):
        torso, thigh, leg, foot = pool.hardware["link_length"][robot]
        assert -model.body("thigh").pos[2] * 2 == pytest.approx(torso)
        assert -model.body("leg").pos[2] == pytest.approx(thigh)
        assert -model.body("foot").pos[2] == pytest.approx(leg)
        assert model.geom("foot").size[1] * 2 == pytest.approx(foot)


def test_mass_and_inertia_scale_together():
    double = dataclasses.replace(nominal_ranges(), torso_mass_ratio=(2.0, 2.0))
    one = next(compile_models(sample_hardware(nominal_ranges(), 1, 0))).body("torso")
    two = next(compile_models(sample_hardware(double, 1, 0))).body("torso")
    assert two.mass == pytest.approx(2 * one.mass)
    np.testing.assert_allclose(two.inertia, 2 * one.inertia)


def test_robot_i_is_the_same_whatever_the_size_of_the_pool():
    small, large = sample_hardware(HopperRanges(), 3, seed=5), sample_hardware(HopperRanges(), 9, seed=5)
    for name, values in small.items():
        np.testing.assert_array_equal(values, large[name][:3])


def test_splits_and_seeds_share_no_robot():
    pools = [make_hopper_pool(HopperRanges(), 4, seed, split) for seed in (0, 1) for split in ("train", "heldout", "new")]
    lengths = {tuple(row) for pool in pools for row in pool.hardware["link_length"]}
    assert len(lengths) == 24


def test_the_torso_mass_pool_varies_in_nothing_else():
    pool = make_hopper_pool(torso_mass_only(), 16, seed=0)
    assert np.ptp(pool.hardware["body_mass"][:, 0]) > 0
    for name in ("link_length", "damping", "frictionloss", "armature"):
        assert np.ptp(pool.hardware[name], axis=0).max() == 0
    assert np.ptp(pool.hardware["body_mass"][:, 1:], axis=0).max() == 0


def test_building_grows_no_worse_than_linearly_with_the_number_of_robots():
    def seconds(count):
        began = time.perf_counter()
        make_hopper_pool(HopperRanges(), count, seed=0)
        return time.perf_counter() - began

    seconds(10)
    assert seconds(400) < 20 * max(seconds(50), 0.02)

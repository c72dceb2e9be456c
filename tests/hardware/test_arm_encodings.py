import dataclasses

import numpy as np
import pytest

from hcp_jax.hardware.arm_encodings import ARM_ENCODINGS, encode_arms
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.ranges import ArmRanges, nominal_lengths

LENGTHS = {"none": 0, "chain": 48, "dynamics": 28, "chain+dynamics": 76, "random": 28}


@pytest.fixture(scope="module")
def arms():
    return make_arm_pool("reacher", ArmRanges(), ["A", "H", "I"], 3, seed=2)


@pytest.mark.parametrize("encoding", ARM_ENCODINGS)
def test_encodings_have_the_documented_length(arms, encoding):
    assert encode_arms(arms, encoding, arms).shape == (9, LENGTHS[encoding])


def test_chain_is_position_and_rotation_of_each_joint_in_the_one_before_then_zeros(arms):
    chain = encode_arms(arms, "chain", arms).reshape(9, 8, 6)
    np.testing.assert_allclose(chain[..., :3], arms.hardware["chain_pos"], atol=1e-6)
    np.testing.assert_array_equal(chain[:3, 6:], 0.0)  # type A: 5 joints and the end effector
    assert np.abs(chain[:3, 5, :3]).max() > 0.05
    np.testing.assert_allclose(np.abs(chain[6, 1, 3:]).max(), np.pi / 2, atol=1e-3)  # j1 lies across j0


def test_chain_differs_if_and_only_if_links_or_joints_do():
    one = make_arm_pool("reacher", nominal_lengths(ArmRanges()), ["I", "G"], 2, seed=2)
    other = make_arm_pool("reacher", nominal_lengths(ArmRanges(damping=(3.0, 4.0))), ["I", "G"], 2, seed=2)
    same = encode_arms(one, "chain", one)
    np.testing.assert_array_equal(same, encode_arms(other, "chain", one))
    np.testing.assert_array_equal(same[0], same[1])
    assert np.abs(same[0] - same[2]).max() > 0.1
    for link in (field.name for field in dataclasses.fields(ArmRanges) if field.name.startswith("l")):
        longer = dataclasses.replace(nominal_lengths(ArmRanges()), **{link: (0.01, 0.01)})
        changed = encode_arms(make_arm_pool("reacher", longer, ["I"], 1, seed=2), "chain", one)
        assert np.abs(changed[0] - same[0]).max() == pytest.approx(0.01, abs=1e-4), link


def test_dynamics_span_0_to_1_and_are_0_for_missing_joints(arms):
    dynamics = encode_arms(arms, "dynamics", arms).reshape(9, 4, 7)
    assert dynamics.min() == 0.0
    assert dynamics.max() == pytest.approx(1.0)
    np.testing.assert_array_equal(dynamics[:3, :, 5:], 0.0)


def test_a_robot_keeps_its_random_vector_beside_robots_with_other_start_poses():
    alone, beside = (make_arm_pool("reacher", ArmRanges(), types, 1, seed=0) for types in (("R5",), ("R5", "H")))
    np.testing.assert_array_equal(encode_arms(alone, "random", alone)[0], encode_arms(beside, "random", beside)[0])

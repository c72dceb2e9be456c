import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hcp_jax.hardware.arm import LINK_EFFECTS, arm_spec
from hcp_jax.hardware.ranges import LINK_LENGTHS, ArmRanges, HopperRanges, RangeError, sample_half_below_one, sample_uniform

finite = st.floats(0.001, 100.0)


@given(finite, finite, st.integers(0, 1000))
def test_draws_stay_inside_the_range(a, b, seed):
    low, high = min(a, b), max(a, b)
    rng = np.random.default_rng(seed)
    assert low <= sample_uniform(rng, (low, high)) <= high
    assert low <= sample_half_below_one(rng, (low, high)) <= high


def test_half_of_the_draws_lie_below_one():
    rng = np.random.default_rng(0)
    draws = np.array([sample_half_below_one(rng, (0.01, 5.0)) for _ in range(4000)])
    assert 0.47 < np.mean(draws < 1.0) < 0.53
    assert np.mean(draws[draws > 1.0]) == pytest.approx(3.0, abs=0.1)


def test_a_zero_width_range_gives_its_value_exactly():
    assert sample_uniform(np.random.default_rng(0), (0.3, 0.3)) == 0.3


@pytest.mark.parametrize(("task", "robot_type"), [("reacher", "I"), ("peg_insertion", "I"), ("peg_insertion", "J")])
def test_a_link_may_become_as_short_as_it_can_without_turning_round(task, robot_type):
    arm = arm_spec(task, robot_type)
    for link, effect in LINK_EFFECTS.items():
        assert abs(arm.body(effect.child).pos[effect.axis]) in (pytest.approx(LINK_LENGTHS[link]), 0.0)
        ArmRanges(**{link: (-LINK_LENGTHS[link], 0.0)})
        with pytest.raises(RangeError, match=f"ranges.{link}=.*must not be below"):
            ArmRanges(**{link: (-LINK_LENGTHS[link] - 1e-3, 0.0)})


@pytest.mark.parametrize(
    "ranges", [{"damping": (-1.0, 2.0)}, {"armature": (2.0, 1.0)}, {"leg_length": (0.0, 0.5)}, {"frictionloss": (0.0, np.inf)}]
)
def test_an_impossible_range_is_refused_by_name(ranges):
    with pytest.raises(RangeError, match=f"ranges.{next(iter(ranges))}="):
        HopperRanges(**ranges)

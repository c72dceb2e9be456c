import numpy as np
import pytest

from hcp_jax.hardware.encodings import encode
from hcp_jax.hardware.hopper import make_hopper_pool
from hcp_jax.hardware.ranges import HopperRanges


@pytest.mark.parametrize(("encoding", "width"), [("none", 0), ("kinematics", 4), ("kinematics+dynamics", 17), ("random", 17)])
def test_each_encoding_has_its_documented_length(pool, encoding, width):
    assert encode(pool, encoding, pool).shape == (pool.num_robots, width)


def test_kinematics_are_standardised_and_dynamics_scaled_over_the_pool(pool):
    v_h = encode(pool, "kinematics+dynamics", pool)
    np.testing.assert_allclose(v_h[:, :4].mean(axis=0), 0, atol=1e-5)
    np.testing.assert_allclose(v_h[:, :4].std(axis=0), 1, atol=1e-5)
    np.testing.assert_allclose(v_h[:, 4:].min(axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(v_h[:, 4:].max(axis=0), 1, atol=1e-6)


def test_the_encoding_differs_if_and_only_if_the_encoded_hardware_differs(pool):
    changed = {"link_length": {"kinematics", "kinematics+dynamics"}, "damping": {"kinematics+dynamics"}}
    for name, encodings in changed.items():
        values = pool.hardware[name].copy()
        values[3] *= 1.1
        other = pool.replace(hardware=pool.hardware | {name: values})
        for encoding in ("kinematics", "kinematics+dynamics"):
            rows = np.any(encode(other, encoding, pool) != encode(pool, encoding, pool), axis=1)
            assert rows.tolist() == [row == 3 and encoding in encodings for row in range(pool.num_robots)]


def test_heldout_robots_use_the_training_pools_scale(pool):
    heldout = make_hopper_pool(HopperRanges(), 4, 0, "heldout")
    half = heldout.hardware["link_length"] / 2
    reference = pool.hardware["link_length"] / 2
    expected = (half - reference.mean(axis=0)) / reference.std(axis=0)
    np.testing.assert_allclose(encode(heldout, "kinematics", pool), expected, rtol=1e-5)


def test_a_robot_keeps_its_random_vector_in_any_pool(pool):
    v_h = encode(pool, "random", pool)
    np.testing.assert_array_equal(encode(pool.subset([7, 2]), "random", pool), v_h[[7, 2]])
    assert len(np.unique(v_h[:, 0])) == pool.num_robots


def test_an_unknown_encoding_is_refused(pool):
    with pytest.raises(ValueError, match="expected one of none, kinematics"):
        encode(pool, "colour", pool)

import numpy as np

from hcp_jax.evaluation.summary import average_curves


def test_curves_are_averaged_at_the_steps_that_all_seeds_have():
    first = np.array([[200.0, 10.0], [400.0, 20.0], [500.0, 99.0], [600.0, 30.0]])  # resumed, with its end at 500 before
    other = np.array([[200.0, 20.0], [400.0, 40.0], [600.0, 60.0], [800.0, 80.0]])
    curve = average_curves([first, other])
    np.testing.assert_array_equal(curve.steps, [200.0, 400.0, 600.0])
    np.testing.assert_array_equal(curve.mean, [15.0, 30.0, 45.0])
    np.testing.assert_array_equal((curve.low, curve.high), [[10.0, 20.0, 30.0], [20.0, 40.0, 60.0]])
    assert curve.num_seeds == 2


def test_curves_without_a_step_in_common_have_no_average():
    assert average_curves([np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]])]) is None
    assert average_curves([np.empty((0, 2))]) is None

import jax.numpy as jnp
import numpy as np

from hcp_jax.algorithms.losses import clipped_surrogate, clipped_value_loss


def test_the_surrogate_stops_rewarding_ratios_outside_the_clip_range():
    advantage = jnp.asarray([1.0, 1.0, -1.0, -1.0])
    ratio = jnp.asarray([1.1, 1.5, 0.9, 0.5])
    expected = -np.mean([1.1, 1.2, -0.9, -0.8])
    np.testing.assert_allclose(clipped_surrogate(jnp.log(ratio), advantage, 0.2), expected, rtol=1e-6)


def test_a_clipped_value_is_charged_the_larger_error():
    value, old, target = jnp.asarray([1.0]), jnp.asarray([0.0]), jnp.asarray([1.0])
    np.testing.assert_allclose(clipped_value_loss(value, old, target, 0.2), 0.5 * 0.8**2, rtol=1e-5)
    np.testing.assert_allclose(clipped_value_loss(value, old, target, 0.0), 0.0, atol=1e-7)

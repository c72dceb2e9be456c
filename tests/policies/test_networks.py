import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.policies.networks import selu


def test_selu_and_its_slope_are_flaxs(rng):
    x = jnp.asarray([-60.0, -1e-4, 0.0, 1e-4, *rng.normal(0.0, 3.0, 100)], jnp.float32)
    np.testing.assert_allclose(selu(x), jax.nn.selu(x), rtol=1e-6, atol=2e-7)
    np.testing.assert_allclose(jax.vmap(jax.grad(selu))(x), jax.vmap(jax.grad(jax.nn.selu))(x), rtol=1e-5, atol=1e-7)

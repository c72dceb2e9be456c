import jax
import jax.numpy as jnp
import numpy as np
from scipy import stats

from hcp_jax.policies.distribution import gaussian_entropy, gaussian_log_prob, sample_gaussian


def test_log_prob_and_entropy_equal_scipys():
    mean, log_std, action = jnp.asarray([[0.1, -0.4]]), jnp.asarray([-0.3, 0.2]), jnp.asarray([[0.5, 0.5]])
    reference = stats.norm(np.asarray(mean), np.exp(np.asarray(log_std)))
    np.testing.assert_allclose(gaussian_log_prob(mean, log_std, action), reference.logpdf(action).sum(axis=-1), rtol=1e-5)
    np.testing.assert_allclose(gaussian_entropy(log_std), reference.entropy().sum(), rtol=1e-5)


def test_samples_have_the_mean_and_spread_asked_for():
    samples = sample_gaussian(jnp.full((20000, 1), 2.0), jnp.log(jnp.asarray([0.5])), jax.random.key(0))
    np.testing.assert_allclose([samples.mean(), samples.std()], [2.0, 0.5], atol=0.02)

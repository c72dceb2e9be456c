"""Diagonal Gaussian over actions with a state-independent standard deviation."""

import jax
import jax.numpy as jnp

_LOG_2PI = 1.8378770664093453


def sample_gaussian(mean: jax.Array, log_std: jax.Array, key: jax.Array) -> jax.Array:
    """Draws actions [..., A] from means [..., A] and log_std [A]."""
    return mean + jnp.exp(log_std) * jax.random.normal(key, mean.shape)


def gaussian_log_prob(mean: jax.Array, log_std: jax.Array, action: jax.Array) -> jax.Array:
    """Log density of `action` [..., A]: [...]."""
    standardised = (action - mean) * jnp.exp(-log_std)
    return -0.5 * jnp.sum(jnp.square(standardised) + 2.0 * log_std + _LOG_2PI, axis=-1)


def gaussian_entropy(log_std: jax.Array) -> jax.Array:
    """Entropy of the distribution: []."""
    return jnp.sum(log_std + 0.5 * (1.0 + _LOG_2PI))

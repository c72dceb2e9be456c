"""Losses of PPO over a minibatch."""

import jax
import jax.numpy as jnp


def clipped_surrogate(log_ratio: jax.Array, advantage: jax.Array, clip_eps: float) -> jax.Array:
    """Negative clipped surrogate objective (Schulman et al. 2017, eq. 7), averaged: []."""
    ratio = jnp.exp(log_ratio)
    clipped = jnp.clip(ratio, 1.0 - clip_eps, 1.0 + clip_eps)
    return -jnp.mean(jnp.minimum(ratio * advantage, clipped * advantage))


def clipped_value_loss(value: jax.Array, old_value: jax.Array, target: jax.Array, clip_eps: float) -> jax.Array:
    """Half the mean squared error, the larger of plain and clipped; `clip_eps` 0 does not clip: []."""
    loss = jnp.square(value - target)
    if clip_eps > 0:
        clipped = old_value + jnp.clip(value - old_value, -clip_eps, clip_eps)
        loss = jnp.maximum(loss, jnp.square(clipped - target))
    return 0.5 * jnp.mean(loss)

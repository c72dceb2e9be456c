"""Returns and advantages of trajectories that end by termination, by success, by truncation, or not at all."""

import chex
import jax
import jax.numpy as jnp


def compute_gae(
    reward: jax.Array,
    value: jax.Array,
    next_value: jax.Array,
    terminated: jax.Array,
    truncated: jax.Array,
    gamma: float,
    gae_lambda: float,
) -> tuple[jax.Array, jax.Array]:
    """Generalised advantage estimation (Schulman et al. 2016, eq. 16) over [T, B] arrays.

    delta_t = r_t + gamma (1 - terminated_t) V(s'_t) - V(s_t), where s'_t is the state that step t led to, before any reset;
    A_t = delta_t + gamma lambda (1 - done_t) A_{t+1}. Termination stops the bootstrap; truncation only cuts the trace.

    Returns:
        advantages [T, B] and value targets A + V [T, B].
    """
    chex.assert_rank([reward, value, next_value, terminated, truncated], 2)
    chex.assert_equal_shape([reward, value, next_value, terminated, truncated])
    delta = reward + gamma * jnp.where(terminated, 0.0, next_value) - value
    trace = gamma * gae_lambda * jnp.where(terminated | truncated, 0.0, 1.0)

    def backward(advantage, inputs):
        delta_t, trace_t = inputs
        advantage = delta_t + trace_t * advantage
        return advantage, advantage

    _, advantages = jax.lax.scan(backward, jnp.zeros_like(delta[0]), (delta, trace), reverse=True)
    return advantages, advantages + value


def compute_n_step_returns(
    reward: jax.Array, success: jax.Array, num_steps: jax.Array, gamma: float
) -> tuple[jax.Array, jax.Array]:
    """The discounted rewards of runs of K steps until the first success, and what the value after them counts for.

    Args:
        reward, success: [N, K] of each step.
        num_steps: [N] of the K steps that count.
        gamma: discount per step.

    Returns:
        returns [N] and discounts [N] of the value of the state after `num_steps` steps, 0 after a success.
    """
    step = jnp.arange(reward.shape[1])
    success = success & (step < num_steps[:, None])
    is_before_success = jnp.cumsum(success, axis=1) - success == 0
    counts = is_before_success & (step < num_steps[:, None])
    discount = jnp.where(jnp.any(success, axis=1), 0.0, gamma ** num_steps.astype(reward.dtype))
    return jnp.sum(jnp.where(counts, gamma**step * reward, 0.0), axis=1), discount

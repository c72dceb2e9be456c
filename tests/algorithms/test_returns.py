import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.training.agents.ppo.losses import compute_gae as brax_gae

from hcp_jax.algorithms.returns import compute_gae, compute_n_step_returns


def column(*values):
    return jnp.asarray(values, jnp.float32)[:, None]


def test_by_hand_a_trace_that_ends_in_termination():
    advantage, target = compute_gae(
        column(1, 1), column(0.5, 0.25), column(0.25, 9), column(0, 1) > 0, column(0, 0) > 0, 0.5, 0.5
    )
    np.testing.assert_allclose(advantage[:, 0], [1 + 0.5 * 0.25 - 0.5 + 0.25 * 0.75, 0.75])
    np.testing.assert_allclose(target[:, 0], advantage[:, 0] + np.array([0.5, 0.25]))


def test_by_hand_a_trace_that_ends_in_truncation_bootstraps_but_does_not_run_on():
    advantage, _ = compute_gae(
        column(1, 1, 1), column(0, 0, 0), column(2, 2, 2), column(0, 0, 0) > 0, column(0, 1, 0) > 0, 0.5, 1.0
    )
    np.testing.assert_allclose(advantage[:, 0], [2 + 0.5 * 2, 2, 2])


def test_termination_wins_over_truncation_in_the_bootstrap():
    advantage, _ = compute_gae(column(1), column(0), column(5), column(1) > 0, column(1) > 0, 0.9, 0.9)
    np.testing.assert_allclose(advantage[:, 0], [1])


def test_lambda_zero_is_the_one_step_error_and_lambda_one_the_discounted_return(rng):
    reward, value = jnp.asarray(rng.normal(size=(6, 3)), jnp.float32), jnp.asarray(rng.normal(size=(6, 3)), jnp.float32)
    next_value = jnp.concatenate([value[1:], jnp.zeros((1, 3))])
    no = jnp.zeros((6, 3), bool)
    one_step, _ = compute_gae(reward, value, next_value, no, no, 0.9, 0.0)
    np.testing.assert_allclose(one_step, reward + 0.9 * next_value - value, rtol=1e-5)
    _, target = compute_gae(reward, value, next_value, no, no, 0.9, 1.0)
    returns = np.zeros((7, 3))
    for t in range(5, -1, -1):
        returns[t] = reward[t] + 0.9 * returns[t + 1]
    np.testing.assert_allclose(target, returns[:6], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_it_equals_braxs_where_braxs_is_defined(seed):
    """brax has no bootstrap at truncation inside a trace (it zeroes that step's error), so without truncation."""
    keys = jax.random.split(jax.random.key(seed), 3)
    reward, value = jax.random.normal(keys[0], (20, 4)), jax.random.normal(keys[1], (20, 4))
    terminated = jax.random.bernoulli(keys[2], 0.2, (20, 4))
    no = jnp.zeros((20, 4), bool)
    next_value = jnp.concatenate([value[1:], jnp.ones((1, 4))])
    ours, _ = compute_gae(reward, value, next_value, terminated, no, 0.97, 0.9)
    targets, _ = brax_gae(no * 1.0, terminated * 1.0, reward, value, jnp.ones(4), lambda_=0.9, discount=0.97)
    np.testing.assert_allclose(targets[-1], (ours + value)[-1], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(targets, ours + value, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("successes", "num_steps", "expected"),
    [((), 3, (-1.75, 0.125)), ((), 2, (-1.5, 0.25)), ((1,), 3, (-0.5, 0.0)), ((2,), 2, (-1.5, 0.25)), ((0, 1), 3, (1.0, 0.0))],
)
def test_rewards_are_summed_to_the_first_success_or_the_last_step_that_counts(successes, num_steps, expected):
    success = jnp.isin(jnp.arange(3), jnp.asarray(successes, jnp.int32))[None]
    result = compute_n_step_returns(jnp.where(success, 1.0, -1.0), success, jnp.array([num_steps]), gamma=0.5)
    np.testing.assert_allclose(jnp.concatenate(result), expected)

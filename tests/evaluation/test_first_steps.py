import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.config import ConfigError
from hcp_jax.evaluation.first_steps import act, fit_v_h, regress_v_h
from hcp_jax.evaluation.hopper_sweeps import evaluate_hoppers
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.policy_file import load_policy


@pytest.fixture(scope="module")
def identified(tiny_config, finished_run):
    run = make_experiment(tiny_config)
    return run, load_policy(finished_run, run)[1]


def test_the_v_h_that_a_robots_steps_were_predicted_with_is_found_again(identified, key):
    run, state = identified
    obs, action = jax.random.normal(key, (60, 5, run.make_env(run.heldout_pool).observation_size)), jnp.zeros((60, 5, 3))
    v_h = jnp.linspace(-1.0, 1.0, 15).reshape(5, 3)
    # A model that is linear in v_h, so that there is one answer.
    network = jax.tree.map(jnp.zeros_like, state.params["network"])
    model = network["params"]["forward_model"]
    model["hidden_0"]["kernel"] = model["hidden_0"]["kernel"].at[-3:, :3].set(jnp.eye(3))
    model["hidden_0"]["bias"] = jnp.full(8, 2.0)  # where SELU is linear
    model["hidden_1"]["kernel"] = jnp.eye(8)
    model["output"]["kernel"] = model["output"]["kernel"].at[:3, :3].set(jnp.eye(3))
    size = obs.shape[-1]
    statistics = state.model_statistics.replace(mean=jnp.zeros(2 * size), std=jnp.ones(2 * size))
    state = state.replace(params=state.params | {"network": network}, model_statistics=statistics)
    repeated = jnp.broadcast_to(v_h, (60, 5, 3))
    change = run.learner.network.apply(network, obs, action, repeated, method="predict")
    found = fit_v_h(run.learner, state, jnp.concatenate([obs, change], axis=-1), action, key)
    np.testing.assert_allclose(found, v_h, atol=0.05)


def test_every_robot_makes_its_own_steps_and_starts_again_where_it_fell(identified, key):
    run, state = identified
    env = run.make_env(run.heldout_pool)
    variables, actions = jax.jit(act, static_argnums=(0, 1, 3))(run.learner, env, state, 60, key)
    assert variables.shape == (60, 4, 2 * env.observation_size)
    assert actions.shape == (60, 4, env.action_size)
    obs, change = np.split(np.asarray(variables), 2, axis=-1)
    goes_on = np.isclose(obs[1:], (obs + change)[:-1], atol=1e-4).all(axis=-1)  # [T - 1, N]
    assert (~goes_on).any(axis=0).all(), "no robot fell: the test says nothing"
    starts = np.concatenate([obs[:1], np.where(goes_on[..., None], obs[:1], obs[1:])])
    np.testing.assert_allclose(starts[..., 0], obs[0, 0, 0], atol=0.02)  # the height of every start


def test_first_steps_need_a_run_with_a_forward_model(tiny_config, identified, key):
    run, state = identified
    with pytest.raises(ConfigError, match="--first-steps=0: expected at least 1"):
        regress_v_h(run, state, run.heldout_pool, [5, 0], key)
    plain = dataclasses.replace(tiny_config, encoding="none")
    blind = make_experiment(plain)
    with pytest.raises(ConfigError, match="--first-steps: tiny has no forward model"):
        regress_v_h(blind, blind.init_state(), blind.heldout_pool, [5], key)


def test_robots_with_a_regressed_v_h_are_a_set_of_their_own(finished_run):
    record = evaluate_hoppers(finished_run, 1, 4, first_steps=[5, 10])
    assert {"heldout_first_5", "heldout_first_10"} <= set(record["sets"])

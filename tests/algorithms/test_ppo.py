import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probe_envs import ProbeEnv

from hcp_jax.algorithms.identification import standardize_embedding
from hcp_jax.algorithms.ppo import PPO
from hcp_jax.config import EmbeddingConfig, PPOConfig
from hcp_jax.policies.conditioning import Embedding

NUM_ENVS = 16
CONFIG = PPOConfig(
    unroll_length=16,
    num_epochs=4,
    num_minibatches=4,
    learning_rate=5e-3,
    final_learning_rate=5e-3,
    gamma=0.5,
    entropy_cost=0.0,
    value_clip_eps=0.0,
    hidden_sizes=(16, 16),
)
EMBEDDING = EmbeddingConfig(size=2, initial_scale=0.05, learning_rate=1e-2)
IDENTIFIED = dataclasses.replace(EMBEDDING, identify_steps=3 * NUM_ENVS * CONFIG.unroll_length)


class NoHardware:
    """v_h of length 0 for any robot."""

    is_learned = False
    size = 0

    def init(self, key):
        return None

    def v_h(self, embedding, index):
        return jnp.zeros((*index.shape, 0))


def learn(env, conditioning=None, iterations=60, seed=0, config=CONFIG, embedding=EMBEDDING):
    ppo = PPO(env, conditioning or NoHardware(), config, embedding, NUM_ENVS, iterations)
    return ppo, ppo.train(ppo.init(jax.random.key(seed)), iterations)


def value_at(ppo, state, step: int) -> float:
    obs = jnp.asarray([[1.0, float(step)]])
    return float(ppo.network.apply(state.params["network"], obs, jnp.zeros((1, ppo.conditioning.size)), method="value")[0])


def mean_action(ppo, state, step: int, robot: int = 0) -> float:
    v_h = ppo.conditioning.v_h(state.params["embedding"], jnp.asarray([robot]))
    obs = jnp.asarray([[1.0, float(step)]])
    return float(ppo.mean_action(state.params["network"], state.obs_statistics, obs, v_h)[0, 0])


def test_the_value_of_a_one_step_episode_is_its_reward():
    ppo, state = learn(ProbeEnv(1, lambda index, step, first, action: jnp.ones(index.shape)))
    assert value_at(ppo, state, 0) == pytest.approx(1.0, abs=0.05)


def test_a_reward_one_step_away_is_discounted_once():
    ppo, state = learn(ProbeEnv(2, lambda index, step, first, action: (step == 1) * 1.0))
    assert value_at(ppo, state, 1) == pytest.approx(1.0, abs=0.1)
    assert value_at(ppo, state, 0) == pytest.approx(0.5, abs=0.1)


def test_a_truncated_episode_is_worth_as_much_as_an_endless_one():
    """Reward 1 for ever at gamma 0.5 is worth 2, though no episode is longer than 2 steps; its steps look alike."""
    env = ProbeEnv(2, lambda index, step, first, action: jnp.ones(index.shape), truncates=True)
    env._observe = lambda step: jnp.ones((*step.shape, 2))
    ppo, state = learn(env, iterations=80)
    assert value_at(ppo, state, 1) == pytest.approx(2.0, abs=0.15)


def test_an_action_gets_the_credit_for_the_next_steps_reward():
    ppo, state = learn(ProbeEnv(2, lambda index, step, first, action: (step == 1) * -jnp.square(first - 0.6)))
    assert mean_action(ppo, state, 0) == pytest.approx(0.6, abs=0.15)


def opposite_actions(index, step, first, action):
    return jnp.where(index == 0, action, -action)


def test_two_robots_that_need_opposite_actions_are_solved_with_an_embedding():
    ppo, state = learn(ProbeEnv(1, opposite_actions), Embedding(2, 2, 0.05))
    assert mean_action(ppo, state, 0, robot=0) > 0.8
    assert mean_action(ppo, state, 0, robot=1) < -0.8


def test_two_robots_that_need_other_actions_are_met_halfway_without_v_h():
    ppo, state = learn(ProbeEnv(1, lambda index, step, first, action: -jnp.square(action - jnp.where(index == 0, 0.8, 0.2))))
    assert mean_action(ppo, state, 0) == pytest.approx(0.5, abs=0.1)


def test_a_frozen_network_still_learns_the_embedding_of_new_robots():
    _, state = learn(ProbeEnv(1, opposite_actions), Embedding(2, 2, 0.05))
    network = jax.tree.map(np.asarray, state.params["network"])
    swapped = ProbeEnv(1, lambda index, *args: opposite_actions(1 - index, *args))
    learner = PPO(swapped, Embedding(2, 2, 0.05), CONFIG, EMBEDDING, NUM_ENVS, 60, train_network=False)
    start = learner.init(jax.random.key(1))
    start = start.replace(params={"network": jax.tree.map(jnp.copy, state.params["network"]), "embedding": jnp.zeros((2, 2))})
    fitted = learner.train(start, 60)
    jax.tree.map(np.testing.assert_array_equal, network, fitted.params["network"])
    assert mean_action(learner, fitted, 0, robot=0) < -0.5
    assert mean_action(learner, fitted, 0, robot=1) > 0.5


def learn_embedding(embedding: EmbeddingConfig, iterations: int):
    """Params and state after `iterations`, and the params before."""
    ppo = PPO(ProbeEnv(1, opposite_actions), Embedding(2, 2, 0.05), CONFIG, embedding, NUM_ENVS, 10)
    before = ppo.init(jax.random.key(0))
    start = jax.tree.map(np.asarray, before.params)
    return start, ppo.train(before, iterations)


def test_the_plain_embedding_learns_with_the_policy():
    start, state = learn_embedding(EMBEDDING, 3)
    assert np.abs(np.asarray(state.params["embedding"]) - start["embedding"]).max() > 1e-3
    assert float(state.sums["prediction_loss"]) == 0


def test_the_policy_is_blind_to_v_h_while_robots_are_identified():
    start, state = learn_embedding(IDENTIFIED, 2)
    kernels = [params["network"]["params"]["policy"]["hidden_0"]["kernel"] for params in (start, state.params)]
    np.testing.assert_array_equal(kernels[0][-2:], kernels[1][-2:])
    assert np.abs(np.asarray(kernels[1] - kernels[0])).max() > 1e-3
    assert np.abs(np.asarray(state.params["embedding"]) - start["embedding"]).max() > 1e-3
    assert float(state.sums["prediction_loss"]) > 0


def test_after_identification_the_embedding_is_standardised_and_stands_still_while_the_policy_uses_it():
    identified, later = learn_embedding(IDENTIFIED, 3)[1], learn_embedding(IDENTIFIED, 5)[1]
    embedding = np.asarray(identified.params["embedding"])
    np.testing.assert_allclose(embedding.mean(axis=0), 0, atol=1e-5)
    np.testing.assert_allclose(embedding.std(axis=0), 1, rtol=1e-4)
    np.testing.assert_array_equal(embedding, later.params["embedding"])
    old, new = identified.params["network"]["params"], later.params["network"]["params"]
    jax.tree.map(np.testing.assert_array_equal, old["forward_model"], new["forward_model"])
    assert np.abs(np.asarray(new["policy"]["hidden_0"]["kernel"] - old["policy"]["hidden_0"]["kernel"])[-2:]).max() > 1e-3


def test_the_policy_starts_afresh_once_the_robots_are_identified():
    """Its output is what initialisation gives: nearly nothing, and the log std of the start."""
    network = learn_embedding(IDENTIFIED, 3)[1].params["network"]["params"]
    assert np.abs(np.asarray(network["policy"]["output"]["kernel"])).max() < 0.02
    assert float(network["log_std"][0]) == CONFIG.initial_log_std


def test_the_actor_that_robots_were_identified_under_is_kept():
    before, at_the_end, later = (learn_embedding(IDENTIFIED, iterations)[1] for iterations in (2, 3, 5))
    jax.tree.map(np.testing.assert_array_equal, at_the_end.reserve, later.reserve)
    fresh, acting, kept = before.reserve.network, at_the_end.params["network"]["params"], at_the_end.reserve.network
    np.testing.assert_array_equal(acting["policy"]["output"]["kernel"], fresh["policy"]["output"]["kernel"])
    blind = before.params["network"]["params"]["policy"]["output"]["kernel"]
    assert 0 < np.abs(np.asarray(kept["policy"]["output"]["kernel"] - blind)).max() < 0.5


def test_standardising_the_embedding_leaves_the_predictions_as_they_were(key):
    ppo = PPO(ProbeEnv(1, opposite_actions), Embedding(5, 2, 0.3), CONFIG, IDENTIFIED, NUM_ENVS, 10)
    params = ppo.init_params(key)
    standardised = standardize_embedding(params)
    obs, action = jax.random.normal(key, (5, 2)), jax.random.normal(key, (5, 1))

    def predict(params):
        return ppo.network.apply(params["network"], obs, action, params["embedding"], method="predict")

    np.testing.assert_allclose(predict(standardised), predict(params), atol=1e-5)
    assert np.abs(np.asarray(standardised["embedding"] - params["embedding"])).max() > 0.1
    text = str(jax.make_jaxpr(standardize_embedding)(params))
    assert text.count("dot_general[") == text.count("precision=(Precision.HIGHEST, Precision.HIGHEST)") > 0


def test_the_same_seed_gives_the_same_parameters_and_another_seed_others():
    env = ProbeEnv(2, opposite_actions)
    one, same, other = (learn(env, iterations=3, seed=seed)[1].params["network"] for seed in (0, 0, 1))
    jax.tree.map(np.testing.assert_array_equal, one, same)
    with pytest.raises(AssertionError):
        jax.tree.map(np.testing.assert_array_equal, one, other)


def test_training_in_two_calls_equals_training_in_one():
    env = ProbeEnv(2, opposite_actions)
    ppo = PPO(env, Embedding(2, 2, 0.05), CONFIG, EMBEDDING, NUM_ENVS, 6)
    whole = ppo.train(ppo.init(jax.random.key(0)), 6)
    parts = ppo.train(ppo.train(ppo.init(jax.random.key(0)), 2), 4)
    jax.tree.map(np.testing.assert_array_equal, whole.params, parts.params)


def test_the_learner_compiles_once_whatever_the_number_of_iterations():
    ppo = PPO(ProbeEnv(1, opposite_actions), NoHardware(), CONFIG, EMBEDDING, NUM_ENVS, 6)
    state = ppo.init(jax.random.key(0))
    state = ppo.train(ppo.train(state, 1), 1)
    compiled = ppo.train._cache_size()
    for count in (2, 3):
        state = ppo.train(state, count)
    assert ppo.train._cache_size() == compiled

"""FiLM: v_h scales and shifts the hidden layers of actor and critic."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import traverse_util

from hcp_jax import presets
from hcp_jax.config import ArmPoolConfig, ConfigError, DDPGConfig
from hcp_jax.policies.networks import Critic, DeterministicActor

SIZES, NUM_OTHERS, NUM_FEATURES = (8, 16, 16), 5, 4
KEY = jax.random.key(0)
ACTION = jnp.full((1, 3), 0.5)


@pytest.fixture
def inputs(rng) -> jax.Array:
    return jnp.asarray(rng.uniform(-1, 1, (1, NUM_OTHERS + NUM_FEATURES)), jnp.float32)


def test_before_training_film_networks_are_the_flat_ones(inputs):
    for flat, film, args in (
        (DeterministicActor(SIZES, 3), DeterministicActor(SIZES, 3, film_from=NUM_OTHERS), (inputs,)),
        (Critic(SIZES, True), Critic(SIZES, True, film_from=NUM_OTHERS), (inputs, ACTION)),
    ):
        expected, got = (net.apply(net.init(KEY, *args), *args) for net in (flat, film))
        np.testing.assert_array_equal(got, expected)


def test_every_hidden_layer_after_the_first_learns_a_scale_and_a_shift(inputs):
    critic = Critic(SIZES, True, film_from=NUM_OTHERS)
    params = critic.init(KEY, inputs, ACTION)
    grads = traverse_util.flatten_dict(jax.grad(lambda p: critic.apply(p, inputs, ACTION).sum())(params)["params"])
    for layer, size in ((1, 16), (2, 16)):
        kernel = grads[f"hidden_{layer}_film", "kernel"]
        assert kernel.shape[1] == 2 * size
        assert (jnp.abs(kernel).sum(axis=0) > 0).all()
    assert ("hidden_0_film", "kernel") not in grads


def test_scale_and_shift_act_before_the_activation(inputs):
    actor = DeterministicActor(SIZES, 3, film_from=NUM_OTHERS)
    params = traverse_util.flatten_dict(actor.init(KEY, inputs))
    params["params", "hidden_2_film", "bias"] = jnp.concatenate([jnp.full(16, -1.0), jnp.full(16, 0.25)])
    hidden = jax.nn.selu(jnp.full((1, 16), 0.25))  # scaled by 1 - 1
    output = hidden @ params["params", "output", "kernel"] + params["params", "output", "bias"]
    got = actor.apply(traverse_util.unflatten_dict(params), inputs)
    np.testing.assert_allclose(got, jnp.tanh(output), rtol=1e-5)


def test_v_h_alone_scales_and_shifts(inputs):
    actor = DeterministicActor(SIZES, 3, film_from=NUM_OTHERS)
    params = actor.init(KEY, inputs)
    summaries = [
        actor.apply(params, each, capture_intermediates=True, mutable="intermediates")[1]["intermediates"]["hidden_v_h"]
        for each in (inputs, inputs.at[:, :NUM_OTHERS].add(1.0), inputs.at[:, NUM_OTHERS:].add(1.0))
    ]
    of_these, of_other_observations, of_another_robot = (summary["__call__"][0] for summary in summaries)
    np.testing.assert_array_equal(of_these, of_other_observations)
    assert not np.allclose(of_these, of_another_robot)


def test_film_needs_features_of_the_robot():
    with pytest.raises(ConfigError, match=r"encoding='none': expected one with features of the robot for ddpg.network=film"):
        presets.arm("a", "reacher", "none", ddpg=DDPGConfig(network="film"), pool=ArmPoolConfig(("I",), ()))

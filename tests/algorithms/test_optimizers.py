import jax.numpy as jnp

from hcp_jax.algorithms.optimizers import label_params, mark_kernels

NETWORK = {"params": {"policy": {"hidden_0": {"kernel": 1, "bias": 1}}, "forward_model": {"output": {"kernel": 1, "bias": 1}}}}


def test_weight_decay_is_on_kernels_alone():
    marked = mark_kernels(NETWORK)["params"]["policy"]["hidden_0"]
    assert marked == {"kernel": True, "bias": False}


def test_every_parameter_of_ppo_has_one_optimiser():
    labels = label_params({"network": NETWORK, "embedding": jnp.zeros((2, 2))})
    parts = labels["network"]["params"]
    assert labels["embedding"] == "embedding"
    assert parts["forward_model"]["output"] == {"kernel": "forward_model", "bias": "forward_model"}
    assert parts["policy"]["hidden_0"] == {"kernel": "network", "bias": "network"}

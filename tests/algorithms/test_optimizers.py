import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.algorithms.optimizers import label_params, make_ppo_optimizer, mark_kernels
from hcp_jax.config import EmbeddingConfig, PPOConfig

NETWORK = {"params": {"policy": {"hidden_0": {"kernel": 1, "bias": 1}}, "forward_model": {"output": {"kernel": 1, "bias": 1}}}}
CONFIG = PPOConfig(num_epochs=2, num_minibatches=2, learning_rate=0.1, final_learning_rate=0.02)  # 4 updates per iteration
EMBEDDING = EmbeddingConfig(learning_rate=0.4, model_learning_rate=0.2)


def find_steps(identify_iterations: int, grads: list[float]) -> dict[str, np.ndarray]:
    """How far the parameters of each optimiser go against the gradients of a run of 10 iterations."""
    optimizer = make_ppo_optimizer(CONFIG, EMBEDDING, 10, identify_iterations, train_network=True, train_forward_model=True)
    params = {name: jnp.zeros(1) for name in ("network", "forward_model", "embedding")}

    def update(state, grad):
        updates, state = optimizer.update(jax.tree.map(lambda leaf: leaf + grad, params), state, params)
        return state, jax.tree.map(lambda leaf: -leaf[0], updates)

    return jax.lax.scan(update, optimizer.init(params), jnp.asarray(grads))[1]


@pytest.mark.parametrize(
    ("identify_iterations", "expected"),
    [
        (0, {"network": {0: 0.1, 20: 0.06, 40: 0.02}, "forward_model": {40: 0.04}, "embedding": {0: 0.4, 20: 0.24, 40: 0.08}}),
        (
            4,  # 16 updates, after which the policy's optimiser starts afresh, for 24
            {
                "network": {0: 0.1, 12: 0.06, 24: 0.02, 40: 0.02},
                "forward_model": {0: 0.2, 8: 0.1, 16: 0.0, 40: 0.0},
                "embedding": {0: 0.4, 8: 0.2, 15: 0.025, 16: 0.0, 40: 0.0},
            },
        ),
    ],
)
def test_step_sizes_of_ppo_fall_over_the_run_or_to_0_over_the_identification(identify_iterations, expected):
    steps = find_steps(identify_iterations, [0.3] * 41)  # of a gradient that stays, Adam's step is the whole of it
    for name, values in expected.items():
        np.testing.assert_allclose(steps[name][np.asarray(list(values))], list(values.values()), rtol=1e-3)


def test_gradients_of_ppos_networks_are_clipped_to_their_norm_and_the_embeddings_are_not():
    clipped, free = (find_steps(0, [grad, 1.0]) for grad in (100.0, 1.0))
    assert CONFIG.max_grad_norm == 1.0
    for name in ("network", "forward_model"):
        np.testing.assert_allclose(clipped[name], free[name], rtol=1e-5)
    assert clipped["embedding"][1] < 0.8 * free["embedding"][1]


def test_weight_decay_is_on_kernels_alone():
    marked = mark_kernels(NETWORK)["params"]["policy"]["hidden_0"]
    assert marked == {"kernel": True, "bias": False}


def test_every_parameter_of_ppo_has_one_optimiser():
    labels = label_params({"network": NETWORK, "embedding": jnp.zeros((2, 2))})
    parts = labels["network"]["params"]
    assert labels["embedding"] == "embedding"
    assert parts["forward_model"]["output"] == {"kernel": "forward_model", "bias": "forward_model"}
    assert parts["policy"]["hidden_0"] == {"kernel": "network", "bias": "network"}

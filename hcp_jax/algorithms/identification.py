"""Identification of robots: a learned v_h, grounded in a forward model that predicts a robot's next observation.

v_h and model learn together from what the robots do. Once they are done, v_h is standardised over the robots and stands still,
so that a policy can learn from it as from a measured property of the hardware. The actor that robots are identified under
makes room for another one then.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from brax.training.acme import running_statistics
from flax import struct

# The parts of the network that act and are acted by; the forward model is none of them.
ACTOR_PARTS = ("policy", "value_function", "log_std")
# Bound on the forward model's standardised inputs and targets.
MAX_VARIABLE = 5.0


@struct.dataclass
class Actor:
    """A policy with its value function, and the observations that it was trained on. network: those parts of the params."""

    network: Any
    obs_statistics: running_statistics.RunningStatisticsState


def get_actor(params: dict, obs_statistics: running_statistics.RunningStatisticsState) -> Actor:
    """The actor in `params`."""
    return Actor({name: params["network"]["params"][name] for name in ACTOR_PARTS}, obs_statistics)


def put_actor(actor: Actor, network: dict) -> dict:
    """`network` with that actor's policy and value function."""
    return {"params": network["params"] | actor.network}


def forward_model_variables(obs: jax.Array, next_obs: jax.Array) -> jax.Array:
    """Observation and its change in one control step: [..., 2 O]."""
    return jnp.concatenate([obs, next_obs - obs], axis=-1)


def prediction_loss(
    predict: Callable[[jax.Array, jax.Array, jax.Array], jax.Array],
    variables: jax.Array,
    statistics: running_statistics.RunningStatisticsState,
    action: jax.Array,
    v_h: jax.Array,
) -> jax.Array:
    """Huber error of the predicted change, in units of its standard deviation; kicks of contacts count little: [].

    Args:
        predict: (obs [B, O] standardised, action [B, A], v_h [B, K]) -> change [B, O] standardised.
        variables: of `forward_model_variables`, [B, 2 O].
        statistics: of such variables.
        action: as executed, [B, A].
        v_h: [B, K].
    """
    variables = running_statistics.normalize(variables, statistics, max_abs_value=MAX_VARIABLE)
    obs, change = jnp.split(variables, 2, axis=-1)
    return jnp.mean(optax.huber_loss(predict(obs, action, v_h), change, delta=1.0))


def standardize_embedding(params: dict) -> dict:
    """Embedding with mean 0 and standard deviation 1 over the robots; the forward model's predictions stay what they were."""
    embedding = params["embedding"]
    size = embedding.shape[1]
    mean, std = embedding.mean(axis=0), embedding.std(axis=0) + 1e-8
    parts = params["network"]["params"]
    first = parts["forward_model"]["hidden_0"]
    rows = first["kernel"][-size:]  # v_h is the last of the model's inputs
    first = {
        "kernel": first["kernel"].at[-size:].set(rows * std[:, None]),
        "bias": first["bias"] + jnp.matmul(mean, rows, precision="highest"),
    }
    forward_model = parts["forward_model"] | {"hidden_0": first}
    network = params["network"] | {"params": parts | {"forward_model": forward_model}}
    return {"network": network, "embedding": (embedding - mean) / std}

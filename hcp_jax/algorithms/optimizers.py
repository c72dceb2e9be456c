"""Which parameters an optimiser steps, how far, and how its steps shrink over a run."""

from typing import Any

import jax
import jax.numpy as jnp
import optax

from hcp_jax.config import DDPGConfig, EmbeddingConfig, PPOConfig


def make_ppo_optimizer(
    config: PPOConfig,
    embedding: EmbeddingConfig,
    num_iterations: int,
    identify_iterations: int,
    train_network: bool,
    train_forward_model: bool,
) -> optax.GradientTransformation:
    """Adam for policy and value function, for the forward model, and for the embedding, each with its own schedule.

    Args:
        config, embedding: settings.
        num_iterations: length of the run.
        identify_iterations: of those, the first ones, after which forward model and embedding stand still; 0 for none.
        train_network: False freezes policy and value function.
        train_forward_model: False freezes the forward model.
    """
    updates_per_iteration = config.num_epochs * config.num_minibatches
    decay = config.final_learning_rate / config.learning_rate

    def until_the_end(rate: float) -> optax.Schedule:
        updates = (num_iterations - identify_iterations) * updates_per_iteration
        return optax.linear_schedule(rate, rate * decay, max(1, updates))

    def while_identifying(rate: float) -> optax.Schedule:
        updates = identify_iterations * updates_per_iteration
        # Exactly 0 in the end, which optax's linear schedule is not.
        return lambda count: jnp.where(jnp.asarray(count) < updates, rate * (1.0 - count / updates), 0.0)

    schedule = while_identifying if identify_iterations else until_the_end
    clip = optax.clip_by_global_norm(config.max_grad_norm)
    network = optax.chain(clip, optax.adam(until_the_end(config.learning_rate), eps=1e-5))
    model = optax.chain(clip, optax.adam(schedule(embedding.model_learning_rate), eps=1e-5))
    return optax.multi_transform(
        {
            "network": network if train_network else optax.set_to_zero(),
            "forward_model": model if train_forward_model else optax.set_to_zero(),
            # A row's gradient is its robot's share of a minibatch, so it is tiny: no clipping, a small eps.
            "embedding": optax.adam(schedule(embedding.learning_rate), eps=1e-8),
        },
        label_params,
    )


def make_ddpg_optimizer(
    config: DDPGConfig, num_iterations: int, embedding_learning_rate: float
) -> optax.GradientTransformation:
    """Adam for actor, critic and embedding, whose steps decay over a run of `num_iterations`."""
    num_updates = num_iterations * config.updates_per_iteration
    weight_decay = optax.add_decayed_weights(config.critic_weight_decay, mask=mark_kernels)

    def adam(rate: float) -> optax.GradientTransformation:
        return optax.adam(optax.linear_schedule(rate, rate * config.learning_rate_decay, num_updates))

    return optax.multi_transform(
        {
            "actor": adam(config.actor_learning_rate),
            "critic": optax.chain(weight_decay, adam(config.critic_learning_rate)),
            "embedding": adam(embedding_learning_rate),
        },
        {"actor": "actor", "critic": "critic", "embedding": "embedding"},
    )


def label_params(params: Any) -> Any:
    """Names the optimiser of each parameter: `network`, `forward_model` or `embedding`."""

    def label(path, _) -> str:
        names = {getattr(key, "key", None) for key in path}
        return next((name for name in ("embedding", "forward_model") if name in names), "network")

    return jax.tree_util.tree_map_with_path(label, params)


def mark_kernels(params: Any) -> Any:
    """True at the kernels of dense layers."""
    return jax.tree_util.tree_map_with_path(lambda path, _: getattr(path[-1], "key", None) == "kernel", params)

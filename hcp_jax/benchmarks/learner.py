"""Seconds of one training iteration, and of its parts.

| row | what is timed |
|---|---|
| `iteration` | collecting and learning, as `train` does |
| `collect` | the iteration's control steps, with the least learning: one update of DDPG, one epoch of PPO |
| `update` | one update of all networks: drawing and relabelling of DDPG and the optimiser included |
| `matmul` | the matrix products of such an update alone: its bound |
"""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp

from hcp_jax.algorithms.ddpg import DDPG
from hcp_jax.algorithms.ppo import PPO
from hcp_jax.algorithms.replay import replay_bytes
from hcp_jax.benchmarks.matmuls import Products, count_products, make_bare_products, total_flops
from hcp_jax.benchmarks.physics import time_steps
from hcp_jax.config import Config
from hcp_jax.devices import options_for_batch, replicate
from hcp_jax.experiment.arm import ArmExperiment
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import HopperExperiment

Run = ArmExperiment | HopperExperiment


def benchmark_learner(config: Config, seconds: float) -> list[dict]:
    """Times the training iteration of an experiment.

    Args:
        config: the experiment.
        seconds: shortest time of one measurement; the median of three counts.

    Returns:
        Rows with name, task, num_envs, seconds (of one iteration or update), control_steps_per_s (of collecting rows),
        flops and flops_per_second (of `update` and `matmul`, matrix products counted) and replay_bytes of DDPG.
    """
    run = make_experiment(config)
    assert isinstance(run, (ArmExperiment, HopperExperiment))
    common: dict = {"task": config.task, "num_envs": config.resolved_num_envs}
    if isinstance(run, ArmExperiment):
        common["replay_bytes"] = replay_bytes(run.learner.buffer_shapes())
        passes, updates_per_pass, batch_size = config.ddpg.updates_per_iteration, 1, config.ddpg.batch_size
    else:
        passes, updates_per_pass = config.ppo.num_epochs, config.ppo.num_minibatches
        batch_size = config.steps_per_iteration // updates_per_pass
    num_timed = max(2, passes)
    collect, learn = (time_iteration(*with_passes(run, number), seconds) for number in (1, num_timed))
    each_pass = (learn - collect) / (num_timed - 1)
    one, two = (count_products(*with_passes(run, number), jnp.int32(1)) for number in (1, 2))
    products: Products = two - one
    flops, update = total_flops(products) / updates_per_pass, each_pass / updates_per_pass
    options = options_for_batch(batch_size) if isinstance(run, ArmExperiment) else None
    bare = 1.0 / time_steps(make_bare_products(products, options), seconds)[0] / updates_per_pass

    def collecting_row(name: str, duration: float) -> dict:
        speed = round(config.steps_per_iteration / duration, 1)
        return {"name": name, **common, "seconds": round(duration, 4), "control_steps_per_s": speed}

    def learning_row(name: str, duration: float) -> dict:
        speeds = {"seconds": round(duration, 6), "flops": round(flops), "flops_per_second": round(flops / duration)}
        return {"name": name, **common, "batch_size": batch_size, **speeds}

    return [
        collecting_row("iteration", collect + (passes - 1) * each_pass),
        collecting_row("collect", collect),
        learning_row("update", update),
        learning_row("matmul", bare),
    ]


def with_passes(run: Run, number: int) -> tuple[Callable, object]:
    """`train` and a fresh state of the run's learner, with `number` updates (DDPG) or epochs (PPO) and without a warm-up."""
    learner, config = run.learner, run.config
    if isinstance(learner, DDPG):
        changed = dataclasses.replace(config.ddpg, updates_per_iteration=number, warmup_episodes=0)
        changed_learner = DDPG(
            learner.env, learner.conditioning, changed, learner.num_envs, config.num_iterations, config.embedding.learning_rate
        )
    else:
        changed = dataclasses.replace(config.ppo, num_epochs=number)
        embedding = dataclasses.replace(config.embedding, identify_steps=0)
        changed_learner = PPO(learner.env, learner.conditioning, changed, embedding, learner.num_envs, config.num_iterations)
    return changed_learner.train, replicate(changed_learner.init(jax.random.key(config.seed)))


def time_iteration(train: Callable, state, seconds: float) -> float:
    """Seconds of one iteration of `train(state, n)`."""

    def iterations(count: int) -> None:
        nonlocal state
        state = jax.block_until_ready(train(state, jnp.int32(count)))

    return 1.0 / time_steps(iterations, seconds)[0]

"""Seconds of one training iteration, and of its parts.

| row | what is timed |
|---|---|
| `iteration` | collecting and learning, as `train` does |
| `collect` | of DDPG: the iteration's episodes, with one update |
| `update` | of DDPG: one update of all networks, sampling and relabelling included |
"""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp

from hcp_jax.algorithms.ddpg import DDPG
from hcp_jax.algorithms.replay import replay_bytes
from hcp_jax.benchmarks.physics import time_steps
from hcp_jax.config import Config
from hcp_jax.experiment.arm import ArmExperiment
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import HopperExperiment


def benchmark_learner(config: Config, seconds: float) -> list[dict]:
    """Times the training iteration of an experiment.

    Args:
        config: the experiment.
        seconds: shortest time of one measurement; the median of three counts.

    Returns:
        Rows with name, task, num_envs, seconds (of one iteration or update), control_steps_per_second (of collecting rows), and
        replay_bytes of DDPG.
    """
    run = make_experiment(config)
    assert isinstance(run, (ArmExperiment, HopperExperiment))
    common = {"task": config.task, "num_envs": config.resolved_num_envs}

    def collecting_row(name: str, duration: float) -> dict:
        speed = round(config.batch_size / duration, 1)
        return {"name": name, **common, "seconds": round(duration, 4), "control_steps_per_second": speed}

    if isinstance(run, HopperExperiment):
        return [collecting_row("iteration", time_iteration(run.learner.train, run.init_state(), seconds))]
    num_updates = config.ddpg.updates_per_iteration
    num_timed = max(2, num_updates)
    collect, learn = (time_with_updates(run, number, seconds) for number in (1, num_timed))
    update = (learn - collect) / (num_timed - 1)
    rows = [
        collecting_row("iteration", collect + (num_updates - 1) * update),
        collecting_row("collect", collect),
        {"name": "update", **common, "seconds": round(update, 6), "batch_size": config.ddpg.batch_size},
    ]
    return [row | {"replay_bytes": replay_bytes(run.learner.buffer_shapes())} for row in rows]


def time_with_updates(run: ArmExperiment, num_updates: int, seconds: float) -> float:
    """Seconds of an iteration with `num_updates`, without a warm-up."""
    config = dataclasses.replace(run.config.ddpg, updates_per_iteration=num_updates, warmup_episodes=0)
    learner = run.learner
    learner = DDPG(
        learner.env, learner.conditioning, config, learner.num_envs, run.num_iterations, run.config.embedding.learning_rate
    )
    return time_iteration(learner.train, learner.init(jax.random.key(run.config.seed)), seconds)


def time_iteration(train: Callable, state, seconds: float) -> float:
    """Seconds of one iteration of `train(state, n)`."""

    def iterations(count: int) -> None:
        nonlocal state
        state = jax.block_until_ready(train(state, jnp.int32(count)))

    return 1.0 / time_steps(iterations, seconds)[0]

"""What a pool costs as it grows: building it, holding it, and a control step of all its robots at once."""

import dataclasses
import time
from collections.abc import Iterator

import jax

from hcp_jax.benchmarks.physics import make_rollout, time_steps
from hcp_jax.config import ArmPoolConfig, Config
from hcp_jax.experiment.arm import ArmExperiment
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import HopperExperiment


def benchmark_scale(config: Config, sizes: list[int], seconds: float) -> Iterator[dict]:
    """Builds pools of each size and steps all their robots, one world each, on the default engine with random actions.

    Args:
        config: the experiment whose robots are pooled; arms in equal numbers of each training type.
        sizes: numbers of robots.
        seconds: shortest time of one measurement.

    Yields:
        name, task, num_robots, build_seconds (the held-out robots of the config included), pool_bytes,
        seconds_per_control_step (of all robots), microseconds_per_robot.
    """
    for size in sizes:
        start = time.perf_counter()
        run = make_experiment(with_robots(config, size))
        assert isinstance(run, (ArmExperiment, HopperExperiment))
        build, count = time.perf_counter() - start, run.train_pool.num_robots
        speed, _ = time_steps(make_rollout(run, run.physics, count, with_policy=False), seconds)
        yield {
            "name": "pool",
            "task": config.task,
            "num_robots": count,
            "build_seconds": round(build, 3),
            "pool_bytes": sum(leaf.nbytes for leaf in jax.tree.leaves(run.train_pool)),
            "seconds_per_control_step": round(1.0 / speed, 6),
            "microseconds_per_robot": round(1e6 / speed / count, 3),
        }


def with_robots(config: Config, num_robots: int) -> Config:
    """The config with about `num_robots` training robots and few held-out ones."""
    pool = config.pool
    if isinstance(pool, ArmPoolConfig):
        per_type = max(1, round(num_robots / len(pool.types)))
        return dataclasses.replace(config, pool=dataclasses.replace(pool, robots_per_type=per_type, heldout_per_type=1))
    return dataclasses.replace(config, num_envs=0, pool=dataclasses.replace(pool, num_robots=num_robots, num_heldout=1))

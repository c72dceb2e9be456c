"""What an evaluation says: of what it is, statistics over trials, and a row per robot."""

import pathlib
from collections.abc import Sequence

import numpy as np

from hcp_jax.envs.episodes import Episodes
from hcp_jax.evaluation.new_robots import RangeChange
from hcp_jax.experiment.base import Experiment
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.physics.base import chosen_integrator
from hcp_jax.training import run_folder


def describe_evaluation(
    run: Experiment,
    folder: pathlib.Path,
    iteration: int,
    trials: int,
    robots_per_trial: int,
    ranges: Sequence[RangeChange],
    pool_folder: pathlib.Path | None,
    seed: int,
    best: bool,
) -> dict:
    """What every record of an evaluation starts with: the policy of `folder` after `iteration` iterations, and its robots."""
    config = run.config
    return {
        "run": str(folder),
        "task": config.task,
        "algorithm": config.algorithm,
        "encoding": config.encoding,
        "physics": run.physics,
        "integrator": chosen_integrator(run.physics, config.env.integrator),
        "checkpoint_env_steps": iteration * config.steps_per_iteration,
        "best": best,
        "seed": seed,
        "commit": run_folder.read_commit(),
        "trials": trials,
        "robots_per_trial": robots_per_trial,
        "ranges": {name: [low, high] for name, low, high in ranges},
        "pool": str(pool_folder) if pool_folder else None,
    }


def summarise_trials(trials: Sequence[Episodes]) -> dict[str, float]:
    """Mean return and its standard deviation over trials (each trial: the mean over its robots), and mean length."""
    means = np.asarray([trial.episode_return.mean() for trial in trials])
    return {
        "return_mean": float(means.mean()),
        "return_std": float(means.std()),
        "episode_length_mean": float(np.mean([trial.episode_length.mean() for trial in trials])),
    }


def robot_rows(pool: RobotPool, trials: Sequence[Episodes]) -> list[dict]:
    """One record per episode: robot id, return, length, whether its physics diverged, and its hardware in SI units."""
    rows = []
    for number, trial in enumerate(trials):
        for i, index in enumerate(trial.index):
            rows.append(
                {
                    "trial": number,
                    "robot_id": int(pool.robot_id[index]),
                    "return": round(float(trial.episode_return[i]), 3),
                    "episode_length": int(trial.episode_length[i]),
                    "diverged": bool(trial.diverged[i]),
                    "hardware": {name: [round(float(v), 6) for v in values[index]] for name, values in pool.hardware.items()},
                }
            )
    return rows

"""Evaluation of a run folder over many trials, on robots trained on and on new ones."""

import pathlib
from collections.abc import Sequence

import jax
import numpy as np

from hcp_jax.algorithms.ppo import PPOState
from hcp_jax.config import MAX_SEED, HopperPoolConfig
from hcp_jax.envs.episodes import Episodes
from hcp_jax.evaluation.first_steps import regress_v_h
from hcp_jax.evaluation.new_robots import RangeChange, change_ranges, load_pool
from hcp_jax.evaluation.statistics import describe_evaluation, robot_rows, summarise_trials
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import (
    EmbeddingFitter,
    HopperExperiment,
    heldout_v_h,
    make_evaluator,
    make_heldout_pool,
    train_v_h,
)
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy


def evaluate_hoppers(
    folder: pathlib.Path,
    trials: int,
    robots_per_trial: int,
    physics: str = "auto",
    fit_steps: int | None = None,
    first_steps: Sequence[int] = (),
    seed: int = 0,
    best: bool = False,
    ranges: Sequence[RangeChange] = (),
    pool_folder: pathlib.Path | None = None,
) -> dict:
    """Evaluates the newest checkpoint of a run folder, or its best one.

    Training robots are taken in order, all of them before any twice; new robots are held-out robots
    0..trials*robots_per_trial-1, or those of a saved pool in order, one episode each. Where v_h is learned, new robots get
    the mean embedding (`heldout`) and, if `fit_steps` is above 0, a v_h fitted to their experience with the networks frozen
    (`heldout_fitted`). For each n of `first_steps`, `heldout_first_n` are those with the v_h that their first n control steps
    speak for.

    Args:
        folder: a run folder.
        trials, robots_per_trial: numbers of trials and of robots in each.
        physics: engine, may be `native-INTEGRATOR`.
        fit_steps: control steps of each new robot for fitting; None takes the config's.
        first_steps: numbers of control steps to regress v_h from (`hcp_jax.evaluation.first_steps`).
        seed: seed of the episodes' initial states.
        best: take the checkpoint with the highest return on training robots.
        ranges: ranges that the new robots are drawn from, where others than in training.
        pool_folder: a saved pool to take the new robots from.

    Returns:
        The record that `evaluate --json` writes.

    Raises:
        RunFolderError, CheckpointError, ConfigError, PoolError: the folder or the pool cannot be evaluated.
    """
    run = make_experiment(run_folder.read_config(folder), physics)
    assert isinstance(run, HopperExperiment)
    iteration, state = load_policy(folder, run, best)
    record = describe_evaluation(run, folder, iteration, trials, robots_per_trial, ranges, pool_folder, seed, best)
    record |= {"types": {}, "sets": {}, "robots": []}
    sets = choose_sets(run, state, trials * robots_per_trial, fit_steps, ranges, pool_folder)
    if first_steps:
        heldout, new, _ = sets["heldout"]
        regressed = regress_v_h(run, state, heldout, first_steps, jax.random.key((seed + 1) % (MAX_SEED + 1)))
        sets |= {f"heldout_first_{steps}": (heldout, new, v_h[new]) for steps, v_h in regressed.items()}
    for name, (pool, rows, v_h) in sets.items():
        episodes = play_trials(run, state, pool, rows, v_h, trials, jax.random.key(seed))
        record["sets"][name] = summarise_trials(episodes)
        record["robots"] += [{"set": name} | row for row in robot_rows(pool, episodes)]
    shown = record["sets"]["heldout"]
    record["types"][run.config.task] = {"zero_shot": True} | shown
    record["return_mean"], record["return_std"] = shown["return_mean"], shown["return_std"]
    return record


def choose_sets(
    run: HopperExperiment,
    state: PPOState,
    count: int,
    fit_steps: int | None,
    ranges: Sequence[RangeChange],
    pool_folder: pathlib.Path | None,
) -> dict[str, tuple[RobotPool, np.ndarray, jax.Array]]:
    """The record's sets of robots: a pool, rows [count] of it, and their v_h [count, K]. Arguments as of `evaluate_hoppers`."""
    config = run.config
    drawn = change_ranges(config, ranges).pool
    assert isinstance(drawn, HopperPoolConfig)
    heldout = load_pool(pool_folder, run.train_pool) if pool_folder else make_heldout_pool(drawn, count)
    index, new = (np.arange(count) % pool.num_robots for pool in (run.train_pool, heldout))
    sets = {"train": (run.train_pool, index, train_v_h(run, state.params)[index])}
    sets["heldout"] = (heldout, new, heldout_v_h(run, state.params, heldout)[new])
    fit_steps = config.embedding.fit_steps if fit_steps is None else fit_steps
    if run.learner.conditioning.is_learned and fit_steps:
        fitter = EmbeddingFitter(run, heldout, fit_steps)
        each = f"{fitter.steps_per_robot:,.0f} control steps each"
        print(f"fitting v_h of {heldout.num_robots} new robots, {each}, networks frozen", flush=True)
        sets["heldout_fitted"] = (heldout, new, fitter(state)[new])
    return sets


def play_trials(
    run: HopperExperiment, state: PPOState, pool: RobotPool, rows: np.ndarray, v_h: jax.Array, trials: int, key: jax.Array
) -> list[Episodes]:
    """One episode of each of `rows`, all in one jitted call, split into `trials` equal parts."""
    params = (state.params["network"], state.obs_statistics)
    episodes = make_evaluator(run.learner, run.make_env(pool))(params, run.learner.visible(state, v_h), rows, key)
    parts = np.split(np.arange(len(rows)), trials)
    return [episodes.take(part) for part in parts]

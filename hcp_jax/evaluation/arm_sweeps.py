"""Evaluation of an arm run: success on new robots of each type, with what kept the others from it."""

import pathlib
from collections.abc import Mapping, Sequence

import jax
import numpy as np

from hcp_jax.algorithms.ddpg import DDPGState
from hcp_jax.config import Config, ConfigError
from hcp_jax.envs.goal_episodes import GoalEpisodes
from hcp_jax.evaluation.new_robots import RangeChange, change_ranges, check_types, load_pool
from hcp_jax.evaluation.records import QUANTILES
from hcp_jax.evaluation.statistics import describe_evaluation
from hcp_jax.experiment.arm import ArmExperiment, load_own_robot, make_evaluator, make_heldout_arms, own_robot_name
from hcp_jax.experiment.build import for_own_robots, make_experiment
from hcp_jax.hardware.arm import ALL_TYPES, type_name
from hcp_jax.hardware.inverse_kinematics import is_reachable
from hcp_jax.hardware.own_arm import make_own_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.robot_file import RobotFile, describe_robot
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy


def evaluate_arms(
    folder: pathlib.Path,
    trials: int,
    robots_per_trial: int,
    types: Sequence[str] = (),
    physics: str = "auto",
    seed: int = 0,
    best: bool = False,
    ranges: Sequence[RangeChange] = (),
    pool_folder: pathlib.Path | None = None,
    own_robots: Mapping[str, RobotFile] | None = None,
) -> dict:
    """Evaluates the newest checkpoint of a run folder, or its best one, on held-out robots 0..trials*robots_per_trial-1 of each
    type, one episode each; or on those of a saved pool, in order, all of a type before any twice.

    Args:
        folder: a run folder.
        trials, robots_per_trial: numbers of trials and of robots in each.
        types: robot types; by default those trained on and those left out.
        physics: engine, may be `native-INTEGRATOR`.
        seed: seed of the episodes' goals, start poses and noise.
        best: take the checkpoint with the highest success on held-out robots of the training types.
        ranges: ranges that the new robots are drawn from, where others than in training.
        pool_folder: a saved pool to take the robots from.
        own_robots: arms from files, by name, instead of types; all robots of a name are copies of that arm. By default the one
            that the run was trained on, if there is one.

    Returns:
        The record that `evaluate --json` writes; success in percent, distances in m.

    Raises:
        RunFolderError, CheckpointError, ConfigError, PoolError, RobotFileError: the folder, a type, the pool or an arm cannot
            be evaluated.
    """
    config = run_folder.read_config(folder)
    check_types(config, types)
    run = make_experiment(for_own_robots(config) if own_robots else config, physics)
    assert isinstance(run, ArmExperiment)
    iteration, state = load_policy(folder, run, best)
    record = describe_evaluation(run, folder, iteration, trials, robots_per_trial, ranges, pool_folder, seed, best)
    record |= {"types": {}, "robots": []}
    pools = choose_pools(run, trials * robots_per_trial, types, ranges, pool_folder, own_robots or {})
    known = find_trained_on(run, config, own_robots or {})
    for name, pool in pools.items():
        summary, rows = evaluate_type(run, state, name, pool, trials, robots_per_trial, seed)
        record["types"][name] = {"zero_shot": name not in known} | summary
        record["robots"] += [{"type": name} | row for row in rows]
    return record


def find_trained_on(run: ArmExperiment, config: Config, own_robots: Mapping[str, RobotFile]) -> set[str]:
    """Names of robots that the run of `config` was trained on. An arm of `own_robots` is so by what its file says, whatever it
    is called."""
    if not own_robots:
        return {*run.pool_config.types, own_robot_name(config)}
    trained = describe_robot(load_own_robot(config)) if config.robot else None
    return {name for name, robot in own_robots.items() if describe_robot(robot) == trained}


def choose_pools(
    run: ArmExperiment,
    count: int,
    types: Sequence[str],
    ranges: Sequence[RangeChange],
    pool_folder: pathlib.Path | None,
    own_robots: Mapping[str, RobotFile],
) -> dict[str, RobotPool]:
    """The robots to evaluate, by type: arms from files, those of a saved pool, or held-out robots 0..count-1.

    Arguments as of `evaluate_arms`. Raises ConfigError, PoolError or RobotFileError.
    """
    config = run.config
    if config.robot and not (types or pool_folder or own_robots):
        own_robots = {own_robot_name(config): load_own_robot(config)}
    if own_robots:
        if ranges:
            raise ConfigError("--range: not with an arm from a file, which is as it is")
        return {name: make_own_pool(config.task, robot) for name, robot in own_robots.items()}
    if pool_folder:
        return split_types(load_pool(pool_folder, run.train_pool), types)
    types = types or tuple(dict.fromkeys((*run.pool_config.types, *run.pool_config.left_out)))
    drawn = change_ranges(config, ranges, types)
    return {name: make_heldout_arms(drawn, (name,), count) for name in types}


def evaluate_type(
    run: ArmExperiment, state: DDPGState, name: str, pool: RobotPool, trials: int, robots_per_trial: int, seed: int
) -> tuple[dict, list[dict]]:
    """One episode of each robot of `pool` in order, all of them before any twice: their summary, and a row for each."""
    config = run.config
    evaluator = make_evaluator(config, run.learner, run.make_env, pool, run.train_pool)
    number = ALL_TYPES.index(name) if name in ALL_TYPES else len(ALL_TYPES)
    key_play, key_goal = jax.random.split(jax.random.fold_in(jax.random.key(seed), number))
    index = np.arange(trials * robots_per_trial) % pool.num_robots
    episodes = evaluator(run.learner.policy(state), index, key_play)
    goals, within = np.asarray(episodes.desired_goal), config.env.success_distance
    reachable = is_reachable(pool.subset(index), goals, within, key_goal, config.task == "peg_insertion")
    stuck = np.asarray(immovable_joints(pool)[index].any(axis=1))
    return summarise_type(episodes, reachable, stuck, trials), robot_rows(pool, episodes, reachable)


def split_types(pool: RobotPool, types: Sequence[str]) -> dict[str, RobotPool]:
    """The robots of each of `types` in a pool that contains them all, or of each type that it contains."""
    names = np.asarray([type_name(number) for number in pool.hardware["type"][:, 0]])
    for name in types:
        if name not in names:
            raise ConfigError(f"--types={name}: the pool has robots of type {', '.join(dict.fromkeys(names))}")
    return {str(name): pool.subset(np.flatnonzero(names == name)) for name in types or dict.fromkeys(names)}


def summarise_type(episodes: GoalEpisodes, reachable: np.ndarray, stuck: np.ndarray, trials: int) -> dict:
    """Success over trials, over the goals that the arm can reach at all, and over the arms that can move all their joints;
    final distance [m] and length of each episode, for distributions."""

    def percent(chosen: np.ndarray) -> float | None:
        return 100.0 * float(episodes.success[chosen].mean()) if chosen.any() else None

    means = 100.0 * episodes.success.reshape(trials, -1).mean(axis=1)
    return {
        "success_mean": float(means.mean()),
        "success_std": float(means.std()),
        "reachable_success_mean": percent(reachable),
        "reachable_share": 100.0 * float(reachable.mean()),
        "movable_success_mean": percent(~stuck),
        "immovable_share": 100.0 * float(stuck.mean()),
        "final_distance_quantiles": {f"{q:g}": float(np.quantile(episodes.final_distance, q)) for q in QUANTILES},
        "episode_length_mean": float(episodes.episode_length.mean()),
        "final_distances": np.round(np.asarray(episodes.final_distance, np.float64), 4).tolist(),
        "episode_lengths": np.asarray(episodes.episode_length).tolist(),
    }


def immovable_joints(pool: RobotPool) -> np.ndarray:
    """Joints whose dry friction is above their torque limit: [N, 7] bool. Part of the task as published."""
    return (pool.hardware["frictionloss"] > pool.hardware["torque_limit"]) & (pool.hardware["joint_mask"] > 0)


def robot_rows(pool: RobotPool, episodes: GoalEpisodes, reachable: np.ndarray) -> list[dict]:
    """One record per episode: robot id, outcome, goal, joints that cannot move, and its hardware in SI units."""
    stuck = immovable_joints(pool)
    return [
        {
            "robot_id": int(pool.robot_id[index]),
            "success": bool(episodes.success[row]),
            "final_distance": round(float(episodes.final_distance[row]), 5),
            "episode_length": int(episodes.episode_length[row]),
            "diverged": bool(episodes.diverged[row]),
            "goal": [round(float(value), 5) for value in episodes.desired_goal[row]],
            "goal_reachable": bool(reachable[row]),
            "immovable_joints": np.flatnonzero(stuck[index]).tolist(),
            "hardware": {
                name: np.round(values[index], 6).tolist() for name, values in pool.hardware.items() if name != "start_angles"
            },
        }
        for row, index in enumerate(episodes.index)
    ]

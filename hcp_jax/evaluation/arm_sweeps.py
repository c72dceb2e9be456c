"""Evaluation of an arm run: success on new robots of each type, with what kept the others from it."""

import pathlib
from collections.abc import Mapping, Sequence

import jax
import numpy as np

from hcp_jax.config import ArmConfig, ArmPoolConfig, ConfigError
from hcp_jax.envs.goal_episodes import GoalEpisodes
from hcp_jax.evaluation.new_robots import RangeChange, change_ranges, load_pool
from hcp_jax.evaluation.records import QUANTILES
from hcp_jax.experiment.arm import make_arm_experiment, make_evaluator, make_heldout_arms
from hcp_jax.hardware.arm import OTHER_ARMS, TYPES, type_name
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.hardware.inverse_kinematics import is_reachable
from hcp_jax.hardware.own_arm import make_own_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.robot_file import RobotFile
from hcp_jax.physics.base import default_physics
from hcp_jax.training import run_folder
from hcp_jax.training.warm_start import load_policy


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
        The record that `evaluate --json` writes (DESIGN.md, "The command line"); success in percent, distances in m.

    Raises:
        RunFolderError, CheckpointError, ConfigError, PoolError, RobotFileError: the folder, a type, the pool or an arm cannot
            be evaluated.
    """
    config = run_folder.read_config(folder)
    pools, env_config = config.pool, config.env
    assert isinstance(pools, ArmPoolConfig)
    assert isinstance(env_config, ArmConfig)
    own_name = pathlib.Path(config.robot).stem
    if config.robot and not types and not pool_folder and not own_robots:
        own_robots = {own_name: load_robot(config.robot, config.robot_base or None, config.robot_tip or None)}
    if own_robots and ranges:
        raise ConfigError("--range: not with an arm from a file, which is as it is")
    if not types and not pool_folder and not own_robots:
        types = tuple(dict.fromkeys((*pools.types, *pools.left_out)))
    for name in types:
        if config.task == "reacher" and name in OTHER_ARMS:
            raise ConfigError(f"--types={name}: that arm holds a peg; it is of peg_insertion alone")
    physics = physics if physics != "auto" else config.physics
    run = make_arm_experiment(config, default_physics() if physics == "auto" else physics)
    iteration, state = load_policy(folder, run, best)
    count, upright = trials * robots_per_trial, config.task == "peg_insertion"
    if own_robots:
        pools_by_type = {name: make_own_pool(config.task, robot) for name, robot in own_robots.items()}
    elif pool_folder:
        pools_by_type = split_types(load_pool(pool_folder, run.train_pool), types)
    else:
        drawn = change_ranges(config, ranges)
        pools_by_type = {name: make_heldout_arms(drawn, (name,), count) for name in types}
    record = {
        "run": str(folder),
        "task": config.task,
        "algorithm": config.algorithm,
        "encoding": config.encoding,
        "physics": run.physics,
        "integrator": run.physics.partition("-")[2] if run.physics.startswith("native-") else env_config.integrator,
        "checkpoint_env_steps": iteration * config.batch_size,
        "commit": run_folder.read_commit(),
        "trials": trials,
        "robots_per_trial": robots_per_trial,
        "ranges": {name: [low, high] for name, low, high in ranges},
        "pool": str(pool_folder) if pool_folder else None,
        "types": {},
        "robots": [],
    }
    for name, pool in pools_by_type.items():
        evaluator = make_evaluator(config, run.learner, run.make_env, pool, run.train_pool)
        number = TYPES.index(name) if name in TYPES else len(TYPES)
        key_play, key_goal = jax.random.split(jax.random.fold_in(jax.random.key(seed), number))
        index = np.arange(count) % pool.num_robots
        episodes = evaluator(run.learner.policy(state), index, key_play)
        goals = np.asarray(episodes.desired_goal)
        reachable = is_reachable(pool.subset(index), goals, env_config.success_distance, key_goal, upright)
        stuck = immovable_joints(pool)[index].any(axis=1)
        zero_shot = name not in pools.types and name != own_name
        record["types"][name] = {"zero_shot": zero_shot} | summarise_type(episodes, reachable, stuck, trials)
        record["robots"] += [{"type": name} | row for row in robot_rows(pool, episodes, reachable)]
    return record


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

"""The catalogue's arms beside each other: what policies reach on each without training, and after fine-tuning on it."""

import pathlib
from collections.abc import Sequence

from hcp_jax.config import ConfigError
from hcp_jax.evaluation.arm_sweeps import evaluate_arms
from hcp_jax.hardware.catalogue import catalogue_names, load_robot
from hcp_jax.training.run_folder import read_config


def make_catalogue_table(
    policies: Sequence[pathlib.Path],
    fine_tuned: Sequence[pathlib.Path] = (),
    trials: int = 10,
    episodes_per_trial: int = 100,
    names: Sequence[str] = (),
    physics: str = "auto",
) -> list[dict]:
    """Plays policies on every arm of the catalogue, with the same goals, and each fine-tuned run on its own arm.

    Args:
        policies: run folders or published policies of arms.
        fine_tuned: run folders of `experiments/finetune.py`, at most one for each arm.
        trials, episodes_per_trial: numbers of trials and of episodes in each.
        names: arms of the catalogue; by default all.
        physics: engine, may be `native-INTEGRATOR`.

    Returns:
        one row per arm, in alphabetical order: robot, joints, reachable_share of the goals, zero_shot (a list, as
        `policies`) and fine_tuned (None without such a run), trials, episodes_per_trial, physics, commit. Each of the two
        holds success_mean and success_std over trials, reachable_success_mean, trained (whether the policy was, on that
        arm), policy and control_steps. Success and shares in percent.

    Raises:
        ConfigError: a policy is of hoppers or of another task than the first, an arm is not in the catalogue, a run was not
            trained on one of `names`, or two runs were on the same.
        RunFolderError, CheckpointError: a policy cannot be read.
    """
    first = read_config(policies[0]).task
    for policy in (*policies, *fine_tuned):
        task = read_config(policy).task
        if task == "hopper":
            raise ConfigError(f"{policy}: a policy of hoppers; expected one of arms")
        if task != first:
            raise ConfigError(f"{policy}: of {task}, and {policies[0]} is of {first}; expected one task, with the same goals")
    names = sorted(names or catalogue_names())
    for name in names:
        if name not in catalogue_names():
            raise ConfigError(f"--robots={name}: expected arms out of {', '.join(catalogue_names())}")
    runs = group_by_robot(fine_tuned)
    for robot, folder in runs.items():
        if robot not in names:
            raise ConfigError(f"--fine-tuned={folder}: of {robot}, and --robots has {', '.join(names)}")
    robots = {name: load_robot(name) for name in names}
    records = [evaluate_arms(policy, trials, episodes_per_trial, physics=physics, own_robots=robots) for policy in policies]
    rows = []
    for name in names:
        tuned = None
        if name in runs:
            tuned = summarise(evaluate_arms(runs[name], trials, episodes_per_trial, physics=physics), name)
        row = {
            "robot": name,
            "joints": robots[name].chain.num_joints,
            "reachable_share": round(records[0]["types"][name]["reachable_share"], 2),
            "zero_shot": [summarise(record, name) for record in records],
            "fine_tuned": tuned,
        }
        rows.append(row | {"trials": trials, "episodes_per_trial": episodes_per_trial, "physics": records[0]["physics"]})
    return [row | {"commit": records[0]["commit"]} for row in rows]


def group_by_robot(folders: Sequence[pathlib.Path]) -> dict[str, pathlib.Path]:
    """Fine-tuned runs by the arm of the catalogue that each was trained on. Raises ConfigError."""
    runs: dict[str, pathlib.Path] = {}
    for folder in folders:
        name = read_config(folder).robot
        if name not in catalogue_names():
            raise ConfigError(f"--fine-tuned={folder}: not trained on an arm of the catalogue (robot={name!r})")
        if name in runs:
            raise ConfigError(f"--fine-tuned={folder}: {runs[name]} is of {name} too; expected one run for each arm")
        runs[name] = folder
    return runs


def summarise(record: dict, name: str) -> dict:
    """The part of an evaluation's record that the table shows of one arm."""
    keys = ("success_mean", "success_std", "reachable_success_mean")
    values = {key: record["types"][name][key] for key in keys}
    rounded = {key: None if value is None else round(value, 2) for key, value in values.items()}
    trained = not record["types"][name]["zero_shot"]
    return rounded | {"trained": trained, "policy": record["run"], "control_steps": record["checkpoint_env_steps"]}

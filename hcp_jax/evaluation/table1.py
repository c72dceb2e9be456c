"""The paper's table 1 beside ours: zero-shot success on the type left out, one row for each policy that was evaluated."""

import pathlib
from collections.abc import Iterator, Sequence

import numpy as np

from hcp_jax.config import ArmConfig, ArmPoolConfig, Config
from hcp_jax.evaluation.files import naming, number, optional_number, read_json
from hcp_jax.evaluation.groups import group_by_settings
from hcp_jax.evaluation.summary import (
    deviation_over_seeds,
    name_algorithm,
    read_last_steps,
    read_run_commit,
    read_wall_seconds,
)
from hcp_jax.training.run_folder import read_config

# (task, hole moves, type left out): experiment of HCP-E (that of DDPG+HER is the next), mean and deviation of each [%].
PAPER = {
    ("reacher", False, "H"): (1, (92.5, 1.96), (0.2, 0.4)),
    ("reacher", False, "E"): (3, (88.0, 2.0), (2.7, 2.19)),
    ("peg_insertion", False, "H"): (5, (92.2, 2.75), (0.0, 0.0)),
    ("peg_insertion", False, "E"): (7, (87.6, 2.01), (0.8, 0.6)),
    ("peg_insertion", False, "I"): (9, (65.6, 3.77), (0.1, 0.3)),
    ("peg_insertion", True, "H"): (11, (4.1, 1.5), (0.1, 0.3)),
    ("peg_insertion", True, "E"): (13, (76.1, 3.96), (0.0, 0.0)),
    ("peg_insertion", True, "I"): (15, (23.5, 4.22), (0.2, 0.4)),
}
# How names of a task's experiments begin, with a hole that moves or not.
PREFIXES = {("reacher", False): "reacher", ("peg_insertion", False): "peg", ("peg_insertion", True): "random_peg"}
# What evaluations of one row have in common.
_MEASURED = ("checkpoint_env_steps", "trials", "robots_per_trial", "physics", "integrator")

Runs = Sequence[tuple[str, dict, Config]]  # of one experiment: policy, record and config of each seed (`group_evaluations`)


def make_table1(results: pathlib.Path) -> list[dict]:
    """One row for each experiment, sorted by the paper's number.

    Args:
        results: folder with `arms/runs` and with `arms/evaluations/NAME_sSEED.json`, as `evaluate results/policies/NAME_sSEED
            --json` writes them.

    Returns:
        Rows of `make_row`, of the type left out.
    """
    rows = []
    for runs in group_evaluations(results):
        config, test_type = runs[0][2], left_out_type(runs[0][2])
        experiment, paper = find_paper(config, test_type)
        rows.append(make_row(runs, results, test_type, experiment, paper))
    return sort_rows(rows)


def group_evaluations(results: pathlib.Path) -> Sequence[Runs]:
    """The evaluated runs of each experiment that leaves one type out and was evaluated on it, but for stale records
    (`find_stale`).

    Those together have equal settings (seed aside), equal control steps and equally many trials and robots in each.
    """
    runs: list[tuple[str, dict, Config]] = []
    for path, record, folder in _read_records(results):
        config = read_config(folder)
        assert isinstance(config.pool, ArmPoolConfig)
        is_of_type = len(config.pool.left_out) == 1 and config.pool.left_out[0] in record["types"]
        if is_of_type and record["checkpoint_env_steps"] == read_last_steps(folder):
            runs.append((path.stem, record, config))
    return group_by_settings(runs, lambda run: run[2], lambda run: tuple(run[1][name] for name in _MEASURED))


def find_stale(results: pathlib.Path) -> list[str]:
    """A line for each evaluation that was made before its run was published with more steps."""
    steps = {path: (record["checkpoint_env_steps"], read_last_steps(run)) for path, record, run in _read_records(results)}
    return [
        f"{path}: after {evaluated:,} steps, and its run ends at {last:,}; not in the tables"
        for path, (evaluated, last) in steps.items()
        if evaluated != last
    ]


def _read_records(results: pathlib.Path) -> Iterator[tuple[pathlib.Path, dict, pathlib.Path]]:
    """The evaluations of whole runs, which others are not named after: file, record and the run's folder."""
    for path in sorted((results / "arms" / "evaluations").glob("*.json")):
        folder = results / "arms" / "runs" / path.stem
        if folder.is_dir():
            record = read_json(path, dict)
            with naming(path):
                _check_record(record, path.stem)
            yield path, record, folder


def _check_record(record: dict, policy: str) -> None:
    """Raises KeyError, TypeError or ValueError unless an evaluation's record has what tables are made of, of that policy."""
    if pathlib.PurePath(record["run"]).name != policy:
        raise ValueError(f"run={record['run']!r}: expected the policy {policy}")
    for name in _MEASURED:
        if not isinstance(record[name], str):
            number(record[name])
    for name in ("ranges", "pool", "best"):
        if record.get(name):  # older records do not have all three
            raise ValueError(f"{name}={record[name]!r}: expected the newest checkpoint on arms of the training's ranges")
    for outcome in record["types"].values():
        for name in ("success_mean", "success_std"):
            number(outcome[name])
        optional_number(outcome["reachable_success_mean"])


def left_out_type(config: Config) -> str:
    """The one type that an experiment leaves out."""
    assert isinstance(config.pool, ArmPoolConfig)
    return config.pool.left_out[0]


def find_paper(config: Config, left_out: str) -> tuple[int | None, tuple[float, float] | None]:
    """The paper's number of an experiment and its success on the type left out; None for controls, which are ours alone."""
    assert isinstance(config.env, ArmConfig)
    of_paper = PAPER.get((config.task, config.env.random_hole > 0, left_out))
    if of_paper is None or config.encoding.startswith("none+"):
        return None, None
    number, conditioned, baseline = of_paper
    return (number + 1, baseline) if config.encoding == "none" else (number, conditioned)


def sort_rows(rows: Sequence[dict]) -> list[dict]:
    """By the paper's number, controls last."""
    return sorted(rows, key=lambda row: (row["experiment"] or 99, row["task"], row["encoding"], row["policy"]))


def make_row(
    runs: Runs, results: pathlib.Path, test_type: str, experiment: int | None, paper: tuple[float, float | None] | None
) -> dict:
    """What one experiment's seeds reach on one type of arms.

    Returns:
        experiment, task, train_types, test_type, algorithm, encoding, joint_slots, network, seeds, success_mean,
        success_std_over_trials (mean over seeds), success_std_over_seeds (of a sample, None of one seed),
        reachable_success_mean, control_steps, wall_seconds,
        paper_mean and paper_std (of HCP-E for every v_h, of DDPG+HER for none, None for controls), policy (names), commit.
        Success in percent.
    """
    config = runs[0][2]
    assert isinstance(config.pool, ArmPoolConfig)
    assert isinstance(config.env, ArmConfig)
    measured = [record["types"][test_type] for _, record, _ in runs]
    folders = [results / "arms" / "runs" / name for name, _, _ in runs]
    means = [row["success_mean"] for row in measured]
    deviation = deviation_over_seeds(means)
    reachable = [row["reachable_success_mean"] for row in measured if row["reachable_success_mean"] is not None]
    return {
        "experiment": experiment,
        "task": config.task,
        "train_types": "".join(config.pool.types),
        "test_type": test_type,
        "algorithm": name_algorithm(config.algorithm, config.encoding),
        "encoding": config.encoding,
        "joint_slots": config.env.joint_slots,
        "network": config.ddpg.network,
        "seeds": sorted(config.seed for _, _, config in runs),
        "success_mean": round(float(np.mean(means)), 2),
        "success_std_over_trials": round(float(np.mean([row["success_std"] for row in measured])), 2),
        "success_std_over_seeds": None if deviation is None else round(deviation, 2),
        "reachable_success_mean": round(float(np.mean(reachable)), 2) if reachable else None,
        "control_steps": runs[0][1]["checkpoint_env_steps"],
        "wall_seconds": round(float(np.mean([read_wall_seconds(folder) for folder in folders])), 1),
        "paper_mean": paper and paper[0],
        "paper_std": paper and paper[1],
        "policy": [name for name, _, _ in runs],
        "commit": sorted({read_run_commit(folder) for folder in folders}),
    }

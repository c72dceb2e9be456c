"""Published records as they are read back: tables, evaluations and rehearsals."""

import dataclasses
import pathlib
from collections.abc import Mapping

import numpy as np

from hcp_jax.evaluation.files import naming, number, optional_number, read_json

QUANTILES = (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)  # of the final distance, in records of arms


@dataclasses.dataclass(frozen=True)
class TableRow:
    """A row of `table1.json` or `appendix.json`, as `table1.make_row` gives it."""

    experiment: int | None
    task: str
    train_types: str
    test_type: str
    algorithm: str
    encoding: str
    joint_slots: str
    network: str
    seeds: tuple[int, ...]
    success_mean: float
    success_std_over_trials: float
    success_std_over_seeds: float | None
    reachable_success_mean: float | None
    control_steps: int
    wall_seconds: float
    paper_mean: float | None
    paper_std: float | None
    policy: tuple[str, ...]
    commit: tuple[str, ...]


def read_table(path: pathlib.Path) -> list[TableRow]:
    """Raises RecordError if the file is damaged or its rows have other fields."""
    rows = read_json(path, list)
    with naming(path):
        return [_table_row(row) for row in rows]


def _table_row(row: dict) -> TableRow:
    return TableRow(
        experiment=None if row["experiment"] is None else int(row["experiment"]),
        task=str(row["task"]),
        train_types=str(row["train_types"]),
        test_type=str(row["test_type"]),
        algorithm=str(row["algorithm"]),
        encoding=str(row["encoding"]),
        joint_slots=str(row["joint_slots"]),
        network=str(row["network"]),
        seeds=tuple(int(seed) for seed in row["seeds"]),
        success_mean=number(row["success_mean"]),
        success_std_over_trials=number(row["success_std_over_trials"]),
        success_std_over_seeds=optional_number(row["success_std_over_seeds"]),
        reachable_success_mean=optional_number(row["reachable_success_mean"]),
        control_steps=int(row["control_steps"]),
        wall_seconds=number(row["wall_seconds"]),
        paper_mean=optional_number(row["paper_mean"]),
        paper_std=optional_number(row["paper_std"]),
        policy=tuple(str(name) for name in row["policy"]),
        commit=tuple(str(name) for name in row["commit"]),
    )


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What a policy reached on one type of arms.

    Attributes:
        zero_shot: the type was not trained on.
        success_mean, success_std: [%] over trials.
        episode_length_mean: [control steps].
        distance_quantiles: [m] of the final distance, in the order of `QUANTILES`.
        final_distances: [N] m and
        episode_lengths: [N] control steps of each arm; None in records that hold quantiles alone.
    """

    zero_shot: bool
    success_mean: float
    success_std: float
    episode_length_mean: float
    distance_quantiles: tuple[float, ...]
    final_distances: np.ndarray | None
    episode_lengths: np.ndarray | None


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """A record of arms that `evaluate --json` wrote."""

    path: pathlib.Path
    policy: str
    task: str
    encoding: str
    env_steps: int
    trials: int
    robots_per_trial: int
    ranges: Mapping[str, tuple[float, float]]
    types: Mapping[str, Outcome]


def read_evaluation(path: pathlib.Path) -> Evaluation:
    """Raises RecordError if the file is damaged or no evaluation of arms."""
    record = read_json(path, dict)
    with naming(path):
        return Evaluation(
            path=path,
            policy=pathlib.PurePath(record["run"]).name,
            task=str(record["task"]),
            encoding=str(record["encoding"]),
            env_steps=int(record["checkpoint_env_steps"]),
            trials=int(record["trials"]),
            robots_per_trial=int(record["robots_per_trial"]),
            ranges={name: (number(low), number(high)) for name, (low, high) in record["ranges"].items()},
            types={name: _outcome(values) for name, values in record["types"].items()},
        )


def _outcome(values: dict) -> Outcome:
    return Outcome(
        zero_shot=bool(values["zero_shot"]),
        success_mean=number(values["success_mean"]),
        success_std=number(values["success_std"]),
        episode_length_mean=number(values["episode_length_mean"]),
        distance_quantiles=tuple(number(values["final_distance_quantiles"][f"{q:g}"]) for q in QUANTILES),
        final_distances=_numbers(values.get("final_distances")),
        episode_lengths=_numbers(values.get("episode_lengths")),
    )


@dataclasses.dataclass(frozen=True)
class Rehearsed:
    """What a policy reached on one arm under one of the conditions: success [%], final distances [N] m."""

    success: float
    final_distances: np.ndarray


@dataclasses.dataclass(frozen=True)
class Rehearsal:
    """A record that `rehearse --json` wrote."""

    path: pathlib.Path
    policy: str
    robot: str
    encoding: str
    conditions: Mapping[str, Rehearsed]


def read_rehearsal(path: pathlib.Path) -> Rehearsal:
    """Raises RecordError if the file is damaged or no rehearsal."""
    record = read_json(path, dict)
    with naming(path):
        return Rehearsal(
            path=path,
            policy=pathlib.PurePath(record["run"]).name,
            robot=str(record["robot"]),
            encoding=str(record["encoding"]),
            conditions={name: _rehearsed(values) for name, values in record["conditions"].items()},
        )


def _rehearsed(values: dict) -> Rehearsed:
    distances = np.asarray([number(trial["final_distance"]) for trial in values["trials"]])
    if not len(distances):
        raise ValueError("it has no trials")
    return Rehearsed(number(values["success"]), distances)


def _numbers(values: list | None) -> np.ndarray | None:
    """[N] numbers, None if there are none."""
    return np.asarray([number(value) for value in values]) if values else None

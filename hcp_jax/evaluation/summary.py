"""One row per algorithm from run folders: what `results/*/summary.json` holds."""

import dataclasses
import functools
import pathlib
from collections.abc import Sequence

import numpy as np

from hcp_jax.config import Config
from hcp_jax.evaluation.files import naming, read_json
from hcp_jax.evaluation.groups import group_by_settings
from hcp_jax.training.metrics import METRICS_FILE, TIMING_FILE, read_rows
from hcp_jax.training.run_folder import ENVIRONMENT_FILE, read_config

BASELINES = {"ppo": "PPO", "ddpg": "DDPG+HER"}
ALGORITHM_NAMES = {
    "kinematics": "HCP-E",
    "kinematics+dynamics": "HCP-E+Dyn",
    "chain": "HCP-E",
    "chain_fk": "HCP-E",
    "chain_fk+jacobian": "HCP-E",
    "chain+dynamics": "HCP-E+Dyn",
    "chain_fk+jacobian+dynamics": "HCP-E+Dyn",
    "embedding": "HCP-I",
}
RETURNS = ("train_return", "heldout_return", "heldout_fitted_return")
SUCCESSES = ("train_types_success", "left_out_success")


def summarise_runs(folders: Sequence[pathlib.Path]) -> list[dict]:
    """Groups evaluated runs by configuration (seed aside) and length, and averages their last evaluations.

    Returns:
        Rows with `algorithm`, `encoding`, `name`, `runs` (folders), `seeds`, `env_steps`, mean and sample standard deviation
        over seeds (None for a single one) of each return in `RETURNS` (hopper) or success in percent in `SUCCESSES` (arms),
        `wall_seconds` (mean) and `commit`.
    """
    runs = [(read_config(folder), folder, rows[-1]) for folder in folders if (rows := read_rows(folder / METRICS_FILE))]
    groups = group_by_settings(runs, lambda run: run[0], lambda run: int(run[2]["env_steps"]))
    return [_summarise_group(group) for group in groups]


def _summarise_group(runs: list[tuple[Config, pathlib.Path, dict]]) -> dict:
    config, _, last_row = runs[0]
    row = {
        "algorithm": name_algorithm(config.algorithm, config.encoding),
        "encoding": config.encoding,
        "name": config.name,
        "runs": [folder.name for _, folder, _ in runs],
        "seeds": sorted(run.seed for run, _, _ in runs),
        "env_steps": int(last_row["env_steps"]),
    }
    columns = {key: f"{key}_mean" for key in RETURNS} if config.task == "hopper" else {key: key for key in SUCCESSES}
    for key, column in columns.items():
        values = [float(last[column]) for _, _, last in runs if last.get(column)]
        row[f"{key}_mean"] = round(float(np.mean(values)), 1) if values else None
        deviation = deviation_over_seeds(values)
        row[f"{key}_std"] = None if deviation is None else round(deviation, 1)
    seconds = [read_wall_seconds(folder) for _, folder, _ in runs]
    row["wall_seconds"] = round(float(np.mean(seconds)), 1)
    row["commit"] = sorted({read_run_commit(folder) for _, folder, _ in runs})
    return row


def deviation_over_seeds(values: Sequence[float]) -> float | None:
    """Sample standard deviation (of N - 1); None of fewer than two values."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else None


def name_algorithm(algorithm: str, encoding: str) -> str:
    """The paper's name of an algorithm with its v_h; controls are named after what they add to the baseline."""
    baseline = BASELINES[algorithm]
    if encoding == "none":
        return baseline
    return ALGORITHM_NAMES.get(encoding, f"{baseline}+{encoding.removeprefix('none+')}")


def read_wall_seconds(folder: pathlib.Path) -> float:
    """Time that training took, without what was lost between the newest checkpoint and a kill.

    Seconds go on where a run is resumed; in files from before they did, each process counts from 0. Raises RecordError if the
    file is damaged.
    """
    with naming(folder / TIMING_FILE):
        seconds = [float(row["seconds"]) for row in read_rows(folder / TIMING_FILE)]
    return sum(now for now, after in zip(seconds, [*seconds[1:], 0.0], strict=True) if after < now)


def read_run_commit(folder: pathlib.Path) -> str:
    """The commit that a run was started from. Raises RecordError if its file is damaged."""
    record = read_json(folder / ENVIRONMENT_FILE, dict)
    with naming(folder / ENVIRONMENT_FILE):
        return record["commit"] or "unknown"


def read_last_steps(folder: pathlib.Path) -> int:
    """Control steps at a run's last evaluation; 0 where there is none. Raises RunFolderError if its metrics are damaged."""
    return max((int(row["env_steps"]) for row in read_rows(folder / METRICS_FILE)), default=0)


def read_curve(folder: pathlib.Path, column: str) -> np.ndarray:
    """Control steps and `column` of each evaluation of a run: [E, 2]. Raises RecordError if its metrics are damaged."""
    with naming(folder / METRICS_FILE):
        rows = read_rows(folder / METRICS_FILE)
        points = [(int(row["env_steps"]), float(row[column])) for row in rows if row.get(column)]
    return np.asarray(points).reshape(-1, 2)


@dataclasses.dataclass(frozen=True)
class SeedCurve:
    """A curve over seeds: control steps, mean, lowest and highest value of each evaluation, [E] each."""

    steps: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    num_seeds: int

    @property
    def seeds(self) -> str:
        """`1 seed`, `3 seeds`: for legends."""
        return f"{self.num_seeds} seed{'s' * (self.num_seeds > 1)}"


def average_curves(curves: Sequence[np.ndarray]) -> SeedCurve | None:
    """Curves of several seeds [E, 2] as one, of the steps at which all of them were evaluated; None if there are none."""
    steps = functools.reduce(np.intersect1d, (curve[:, 0] for curve in curves))
    if not len(steps):
        return None
    values = np.stack([curve[np.isin(curve[:, 0], steps), 1] for curve in curves])
    return SeedCurve(steps, values.mean(axis=0), values.min(axis=0), values.max(axis=0), len(curves))


def steps_to_reach(folder: pathlib.Path, column: str, value: float) -> int | None:
    """Control steps of the first evaluation at which `column` is at least `value`; None if it never is."""
    curve = read_curve(folder, column)
    reached = np.flatnonzero(curve[:, 1] >= value)
    return int(curve[reached[0], 0]) if len(reached) else None

"""One row per algorithm from run folders: what `results/*/summary.json` holds."""

import collections
import dataclasses
import json
import pathlib
from collections.abc import Sequence

import numpy as np

from hcp_jax.config import Config
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
    """Groups finished runs by configuration (seed aside) and averages their last evaluations.

    Returns:
        Rows with `algorithm`, `encoding`, `name`, `seeds`, `env_steps`, mean and standard deviation over seeds of each
        return in `RETURNS` (hopper) or success in percent in `SUCCESSES` (arms), `wall_seconds` (mean) and `commit`.
    """
    groups = collections.defaultdict(list)
    for folder in folders:
        rows = read_rows(folder / METRICS_FILE)
        if rows:
            config = read_config(folder)
            groups[(config.name, int(rows[-1]["env_steps"]))].append((config, folder, rows[-1]))
    return [_summarise_group(name, env_steps, runs) for (name, env_steps), runs in groups.items()]


def _summarise_group(name: str, env_steps: int, runs: list[tuple[Config, pathlib.Path, dict]]) -> dict:
    config = runs[0][0]
    row = {
        "algorithm": name_algorithm(config),
        "encoding": config.encoding,
        "name": name,
        "seeds": sorted(run.seed for run, _, _ in runs),
        "env_steps": env_steps,
    }
    columns = {key: f"{key}_mean" for key in RETURNS} if config.task == "hopper" else {key: key for key in SUCCESSES}
    for key, column in columns.items():
        values = [float(last[column]) for _, _, last in runs if last.get(column)]
        row[f"{key}_mean"] = round(float(np.mean(values)), 1) if values else None
        row[f"{key}_std"] = round(float(np.std(values)), 1) if values else None
    seconds = [read_wall_seconds(folder) for _, folder, _ in runs]
    row["wall_seconds"] = round(float(np.mean(seconds)), 1)
    row["commit"] = sorted({read_run_commit(folder) for _, folder, _ in runs})
    return row


def name_algorithm(config: Config) -> str:
    """The paper's name of an algorithm with its v_h; controls are named after what they add to the baseline."""
    baseline, encoding = BASELINES[config.algorithm], config.encoding
    if encoding == "none":
        return baseline
    return ALGORITHM_NAMES.get(encoding, f"{baseline}+{encoding.removeprefix('none+')}")


def read_wall_seconds(folder: pathlib.Path) -> float:
    """Time from start to the last evaluation, summed over the processes that a resumed run had (each counts from 0)."""
    seconds = [float(row["seconds"]) for row in read_rows(folder / TIMING_FILE)]
    return sum(now for now, after in zip(seconds, [*seconds[1:], 0.0], strict=True) if after < now)


def read_run_commit(folder: pathlib.Path) -> str:
    """The commit that a run was started from."""
    return json.loads((folder / ENVIRONMENT_FILE).read_text())["commit"] or "unknown"


def read_curve(folder: pathlib.Path, column: str) -> np.ndarray:
    """Control steps and `column` of each evaluation of a run: [E, 2]."""
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


def average_curves(curves: Sequence[np.ndarray]) -> SeedCurve | None:
    """Curves of several seeds [E, 2] as one, as far as all of them go; None if one of them has no point."""
    length = min(len(curve) for curve in curves)
    if not length:
        return None
    values = np.stack([curve[:length, 1] for curve in curves])
    return SeedCurve(curves[0][:length, 0], values.mean(axis=0), values.min(axis=0), values.max(axis=0), len(curves))


def steps_to_reach(folder: pathlib.Path, column: str, value: float) -> int | None:
    """Control steps of the first evaluation at which `column` is at least `value`; None if it never is."""
    curve = read_curve(folder, column)
    reached = np.flatnonzero(curve[:, 1] >= value)
    return int(curve[reached[0], 0]) if len(reached) else None

"""Metrics of a run: `metrics.csv` with one row per evaluation, `timing.csv` beside it, and TensorBoard events.

`metrics.csv` holds nothing that depends on the clock, so that an interrupted and resumed run writes the same bytes.
"""

import csv
import os
import pathlib
from typing import Any

import tensorboardX

from hcp_jax.training.run_folder import RunFolderError

METRICS_FILE = "metrics.csv"
TIMING_FILE = "timing.csv"


class MetricsWriter:
    """Appends rows; on resume it first drops the rows after the checkpoint.

    Attributes:
        seconds_before: training time [s] of the processes before this one, up to the last row that they left.
    """

    def __init__(self, folder: pathlib.Path, resume_env_steps: int = 0):
        """Raises RunFolderError if a file is damaged or of another version; neither has changed then."""
        self._folder = folder
        before = {name: read_rows(folder / name) for name in (METRICS_FILE, TIMING_FILE)}
        for name, rows in before.items():
            _write_rows(folder / name, [row for row in rows if int(row["env_steps"]) <= resume_env_steps])
        timing = read_rows(folder / TIMING_FILE)
        self.seconds_before = float(timing[-1].get("seconds") or 0.0) if timing else 0.0
        self._events = tensorboardX.SummaryWriter(str(folder / "events"), purge_step=resume_env_steps + 1)

    def write(self, metrics: dict[str, Any], timing: dict[str, Any]) -> None:
        """Adds one evaluation. Both records start with `env_steps`."""
        self._append(METRICS_FILE, metrics)
        self.write_timing(timing)
        for key, value in (metrics | timing).items():
            if key != "env_steps" and value is not None:
                self._events.add_scalar(key, value, metrics["env_steps"])
        self._events.flush()

    def write_timing(self, timing: dict[str, Any]) -> None:
        """Adds a row to `timing.csv` alone, for a run that stops between two evaluations."""
        self._append(TIMING_FILE, timing)

    def _append(self, name: str, record: dict[str, Any]) -> None:
        path, row = self._folder / name, {key: _format(value) for key, value in record.items()}
        rows = read_rows(path)
        unknown = next((column for column in dict(*rows[:1]) if column not in row), None)
        if unknown:
            raise _damaged(path, f"column {unknown} is none that this run has")
        _write_rows(path, [*rows, row])

    def rows(self) -> list[dict[str, str]]:
        """The evaluations so far."""
        return read_rows(self._folder / METRICS_FILE)

    def close(self) -> None:
        self._events.close()


def read_rows(path: pathlib.Path) -> list[dict[str, str]]:
    """Rows of a run's CSV file, all of the same columns; none if it does not exist. Raises RunFolderError if it is damaged."""
    if not path.exists():
        return []
    try:
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
    except (csv.Error, UnicodeDecodeError) as error:
        raise _damaged(path, str(error)) from error
    for row in rows:
        steps = row.get("env_steps")
        if not (steps or "").isdecimal():
            raise _damaged(path, f"env_steps={steps!r}: expected a whole number")
        missing = next((column for column, value in row.items() if value is None), None)
        if missing:
            raise _damaged(path, f"the row of env_steps={steps} has no {missing}")
        if None in row:
            raise _damaged(path, f"the row of env_steps={steps} has more columns than are named, after {list(row)[-2]}")
    return rows


def read_column(path: pathlib.Path, column: str) -> list[float]:
    """One column of a run's CSV file. Raises RunFolderError if it is missing or not of numbers."""
    values = [row.get(column) for row in read_rows(path)]
    try:
        return [float(value or "") for value in values]
    except ValueError as error:
        raise _damaged(path, f"column {column}: expected a number in each row") from error


def _damaged(path: pathlib.Path, what: str) -> RunFolderError:
    return RunFolderError(f"{path}: damaged or of another version ({what})")


def _write_rows(path: pathlib.Path, rows: list[dict[str, str]]) -> None:
    """Replaces the file in one step, so that a kill leaves the old rows or the new ones."""
    temporary = path.with_suffix(".tmp")
    with temporary.open("w", newline="") as file:
        if rows:
            writer = csv.DictWriter(file, fieldnames=list(rows[-1]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def _format(value: float | int | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.9g}"

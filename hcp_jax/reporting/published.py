"""The folder of results that a report is made from: what is there, and what is missing."""

import dataclasses
import pathlib
from collections.abc import Sequence

from hcp_jax.config import Config, ConfigError
from hcp_jax.evaluation.files import naming
from hcp_jax.evaluation.groups import group_by_settings
from hcp_jax.evaluation.records import TableRow, read_table
from hcp_jax.evaluation.summary import SeedCurve, average_curves, read_curve
from hcp_jax.training.metrics import METRICS_FILE
from hcp_jax.training.run_folder import CONFIG_FILE, read_config


@dataclasses.dataclass(frozen=True)
class Run:
    """A published run: its folder and its config."""

    folder: pathlib.Path
    config: Config


class Published:
    """A folder that `collect` and `evaluate --json` wrote into.

    Attributes:
        folder: the folder.
        missing: a line for each file that was looked for and is not there.
        arms, hoppers: runs whose metrics are there, by name.
    """

    def __init__(self, folder: pathlib.Path):
        """Raises ConfigError if `folder` holds nothing of results, RunFolderError or RecordError if a config is damaged."""
        self.folder = folder
        self.missing: list[str] = []
        if not any((folder / name).exists() for name in ("table1.json", "arms", "hopper")):
            raise ConfigError(f"{folder}: no folder of results (it has none of table1.json, arms, hopper)")
        self.arms, self.hoppers = self._runs("arms"), self._runs("hopper")

    def show(self, path: pathlib.Path) -> str:
        """A path from the folder of results on: `results/table1.json`."""
        return str(pathlib.PurePath(self.folder.resolve().name) / path.relative_to(self.folder))

    def find(self, name: str) -> pathlib.Path | None:
        """A file or folder of the results; None, and a line in `missing`, if it is not there."""
        path = self.folder / name
        if path.exists():
            return path
        self.missing.append(f"{path}: missing; the report says so in its place")
        return None

    def table(self, name: str) -> list[TableRow]:
        """Rows of a table; none if its file is missing. Raises RecordError if it is damaged."""
        path = self.find(name)
        return read_table(path) if path else []

    def runs_of(self, names: Sequence[str]) -> list[list[Run]]:
        """The runs of the experiments `names`, in that order. Those that differ in their seed alone, and in the run that they
        start from, are together."""
        runs = [run for name in names for run in (*self.arms, *self.hoppers) if run.config.name == name]
        return group_by_settings(runs, lambda run: run.config)

    def _runs(self, task: str) -> list[Run]:
        folder = self.find(f"{task}/runs")
        runs = []
        for path in sorted(folder.iterdir()) if folder else ():
            if path.is_dir() and self.find(f"{task}/runs/{path.name}/{METRICS_FILE}"):
                with naming(path / CONFIG_FILE):
                    runs.append(Run(path, read_config(path)))
        return runs


def average_runs(runs: Sequence[Run], column: str) -> SeedCurve | None:
    """A column of several seeds' metrics as one curve; None without points. Raises RecordError if a file is damaged."""
    return average_curves([read_curve(run.folder, column) for run in runs])

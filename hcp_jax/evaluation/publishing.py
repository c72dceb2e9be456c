"""What every task publishes of its run folders: metrics, policies and curves."""

import pathlib
import shutil
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from hcp_jax.evaluation.summary import average_curves, read_curve
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.metrics import METRICS_FILE, TIMING_FILE
from hcp_jax.training.policy_file import load_policy, write_policy
from hcp_jax.training.run_folder import CONFIG_FILE, ENVIRONMENT_FILE, read_config


def find_runs(runs: pathlib.Path) -> list[pathlib.Path]:
    """The run folders in `runs` that have been evaluated at least once."""
    return sorted(path.parent for path in runs.glob(f"*/{CONFIG_FILE}") if (path.parent / METRICS_FILE).exists())


def publish_runs(folders: Sequence[pathlib.Path], out: pathlib.Path, policies: pathlib.Path) -> list[pathlib.Path]:
    """Copies each run's metrics to `out/runs` and writes its policy to `policies`.

    Returns:
        all folders of `out/runs`, those of earlier calls too: what tables and curves are made of.
    """
    for folder in folders:
        copy_files(folder, out / "runs" / folder.name, (CONFIG_FILE, ENVIRONMENT_FILE, METRICS_FILE, TIMING_FILE))
        publish_policy(folder, policies / folder.name)
    return find_runs(out / "runs")


def group_by_name(folders: Sequence[pathlib.Path]) -> dict[str, list[pathlib.Path]]:
    """Runs of one experiment with different seeds, by the experiment's name."""
    groups: dict[str, list[pathlib.Path]] = {}
    for folder in folders:
        groups.setdefault(read_config(folder).name, []).append(folder)
    return groups


def copy_files(source: pathlib.Path, target: pathlib.Path, names: Sequence[str]) -> None:
    target.mkdir(parents=True, exist_ok=True)
    for name in names:
        shutil.copy(source / name, target / name)


def publish_policy(folder: pathlib.Path, target: pathlib.Path) -> None:
    """Writes the newest policy of a run, with its config and environment, to `target`."""
    copy_files(folder, target, (CONFIG_FILE, ENVIRONMENT_FILE))
    write_policy(target, load_policy(folder, make_experiment(read_config(folder)))[1])


def plot_groups(groups: Mapping[str, Sequence[pathlib.Path]], path: pathlib.Path, columns: Sequence[str], label: str) -> None:
    """Mean over seeds of each group's curve, with the range over seeds shaded; one panel per column."""
    figure = Figure((6 * len(columns), 4.5), layout="constrained")
    panels = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    for column, axes in zip(columns, panels, strict=True):
        for name, folders in groups.items():
            curve = average_curves([read_curve(folder, column) for folder in folders])
            if curve is None:
                continue  # an experiment without this column
            axes.plot(curve.steps / 1e6, curve.mean, label=f"{name} ({curve.num_seeds} seeds)")
            axes.fill_between(curve.steps / 1e6, curve.low, curve.high, alpha=0.2)
        axes.set_title(column.replace("_", " "))
        axes.set_xlabel("control steps [million]")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel(label)
    panels[0].legend(frameon=False)
    figure.savefig(path, dpi=120)

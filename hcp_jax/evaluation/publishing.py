"""What every task publishes of its run folders: metrics, policies and curves."""

import math
import pathlib
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from hcp_jax.config import ConfigError
from hcp_jax.evaluation.summary import average_curves, read_curve, read_last_steps
from hcp_jax.experiment.base import TrainingState
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.metrics import METRICS_FILE, TIMING_FILE, read_rows
from hcp_jax.training.policy_file import load_policy, write_policy
from hcp_jax.training.run_folder import (
    CONFIG_FILE,
    ENVIRONMENT_FILE,
    POLICY_FILE,
    find_differences,
    read_config,
    saved_robot_path,
)

LINE_STYLES = ("-", "--", ":", "-.")  # of curves that would have the same colour
_FILES = (CONFIG_FILE, ENVIRONMENT_FILE, TIMING_FILE, METRICS_FILE)  # of a run, the one last that makes it one to be found


def find_runs(runs: pathlib.Path) -> list[pathlib.Path]:
    """The run folders in `runs` that have been evaluated at least once."""
    return sorted(path.parent for path in runs.glob(f"*/{CONFIG_FILE}") if _is_evaluated(path.parent))


def _is_evaluated(folder: pathlib.Path) -> bool:
    return (folder / METRICS_FILE).exists() and bool(read_rows(folder / METRICS_FILE))


def publish_runs(
    folders: Sequence[pathlib.Path], out: pathlib.Path, policies: pathlib.Path
) -> tuple[list[pathlib.Path], list[str]]:
    """Writes each run's newest policy to `policies` and copies its metrics to `out/runs`.

    Repetitions, of seeds above 0, are published to be played, without their critics.
    All of `folders` are read before anything is written: one that cannot be read leaves the results as they were.

    Returns:
        all folders of `out/runs`, those of earlier calls too: what tables and curves are made of; and lines about what was
        written, and which evaluations are of a policy that is no longer there.

    Raises:
        ConfigError: a policy of that name is published that was trained with other settings, or for longer; nothing is
            written.
    """
    for folder in folders:
        _check_replaceable(folder, policies / folder.name, out / "runs" / folder.name)
    read = [(folder.name, *_read_run(folder)) for folder in folders]
    lines = [f"{out}/runs, {policies}: {', '.join(folder.name for folder in folders)}"] if folders else []
    for name, files, state, critic in read:
        _write_files(policies / name, {key: files[key] for key in files if key not in (TIMING_FILE, METRICS_FILE)})
        path = policies / name / POLICY_FILE
        before = path.read_bytes() if path.exists() else None
        write_policy(policies / name, state, critic)
        if before not in (None, path.read_bytes()):
            stale = [*find_records(out, name), *find_records(policies.parent / "rehearsal", name)]
            lines += [f"{record}: of the policy that {policies / name} held before; measure it anew" for record in stale]
        _write_files(out / "runs" / name, files)
    return find_runs(out / "runs"), lines


def find_records(folder: pathlib.Path, policy: str) -> list[pathlib.Path]:
    """What was measured of a published policy: `POLICY.json` and `POLICY_*.json` in `folder` and the folders in it."""
    return sorted(path for path in folder.rglob(f"{policy}*.json") if f"{path.stem}_".startswith(f"{policy}_"))


def _check_replaceable(folder: pathlib.Path, policy: pathlib.Path, run: pathlib.Path) -> None:
    """Raises ConfigError if another run than `folder` is published under its name, in the folders `policy` and `run`."""
    differences = find_differences(read_config(policy), read_config(folder)) if policy.exists() else []
    if differences:
        name, old, new = differences[0]
        raise ConfigError(
            f"{folder}: its {name} is {new!r}, and {old!r} in {policy}, which it would replace; name it otherwise"
        )
    steps, published = (read_last_steps(each) for each in (folder, run))
    if steps < published:
        raise ConfigError(f"{folder}: evaluated up to {steps:,} steps, and {run}, which it would replace, up to {published:,}")


def _read_run(folder: pathlib.Path) -> tuple[dict[str, bytes], TrainingState, bool]:
    """The files of a run that are published, a state that holds its newest policy, and whether the critic is published too."""
    config = read_config(folder)
    saved = saved_robot_path(folder, config)
    names = (str(saved.relative_to(folder)), *_FILES) if saved.exists() else _FILES
    files = {name: (folder / name).read_bytes() for name in names}
    return files, load_policy(folder, make_experiment(config))[1], config.seed == 0


def _write_files(folder: pathlib.Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def plot_groups(groups: Mapping[str, Sequence[pathlib.Path]], path: pathlib.Path, columns: Sequence[str], label: str) -> None:
    """Mean over seeds of each group's curve, with the range over seeds shaded; one panel per column."""
    legend_columns = len(columns)
    figure = Figure((6 * len(columns), 4.5 + 0.22 * math.ceil(len(groups) / legend_columns)), layout="constrained")
    panels = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    for column, axes in zip(columns, panels, strict=True):
        for number, (name, folders) in enumerate(groups.items()):
            colour, style = f"C{number % 10}", LINE_STYLES[number // 10 % len(LINE_STYLES)]
            curve = average_curves([read_curve(folder, column) for folder in folders])
            if curve is None:
                continue  # an experiment without this column
            axes.plot(curve.steps / 1e6, curve.mean, style, color=colour, label=f"{name} ({curve.seeds})")
            axes.fill_between(curve.steps / 1e6, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
        axes.set_title(column.replace("_", " "))
        axes.set_xlabel("control steps [million]")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel(label)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=legend_columns, frameon=False)
    figure.savefig(path, dpi=120)

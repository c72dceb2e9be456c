"""Learning curves as a picture."""

import pathlib

import numpy as np
from matplotlib.figure import Figure

from hcp_jax.training.metrics import METRICS_FILE, read_rows

CURVES_FILE = "curves.png"  # what a run writes last
_SERIES = {
    "train_return_mean": "training robots",
    "heldout_return_mean": "held-out robots",
    "heldout_fitted_return_mean": "held-out robots, fitted v_h",
    "train_types_success": "held-out robots of the training types",
    "left_out_success": "types left out",
    "training_robots_success": "training robots with their own v_h",
}


def plot_curves(folder: pathlib.Path, path: pathlib.Path) -> None:
    """Draws the evaluation returns or success rates of a run folder over control steps into a PNG file."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    rows = read_rows(folder / METRICS_FILE)
    for column, label in _SERIES.items():
        points = [(int(row["env_steps"]) / 1e6, float(row[column])) for row in rows if row.get(column)]
        if points:
            x, y = np.asarray(points).T
            axes.plot(x, y, marker="o", markersize=3, label=label)
    axes.set_xlabel("control steps [million]")
    axes.set_ylabel("success [%]" if "train_types_success" in dict(*rows[:1]) else "return of one episode")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=130)

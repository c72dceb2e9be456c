"""What a learned embedding says about the hardware behind it (paper, figure 4c)."""

import pathlib

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import cKDTree


def knn_r2(embedding: np.ndarray, target: np.ndarray, neighbours: int = 5, folds: int = 5, seed: int = 0) -> float:
    """Cross-validated R^2 of predicting `target` [N] by the mean of the nearest neighbours in `embedding` [N, K]."""
    fold = np.random.default_rng(seed).permutation(len(target)) % folds
    predicted = np.empty(len(target))
    for k in range(folds):
        tree = cKDTree(embedding[fold != k])
        _, rows = tree.query(embedding[fold == k], k=range(1, neighbours + 1))
        predicted[fold == k] = target[fold != k][rows].mean(axis=1)
    return float(1.0 - np.mean((target - predicted) ** 2) / np.var(target))


def scatter_embedding(axes: Axes, embedding: np.ndarray, mass: np.ndarray) -> None:
    """A 2-D embedding [N, 2], coloured by mass [N] in kg."""
    points = axes.scatter(*embedding.T, c=mass, s=8, cmap="viridis", linewidths=0)
    axes.figure.colorbar(points, label="torso mass [kg]")
    axes.set_xlabel("v_h, first number")
    axes.set_ylabel("v_h, second number")


def plot_embedding(embedding: np.ndarray, mass: np.ndarray, path: pathlib.Path) -> None:
    """Writes `scatter_embedding` to an image file."""
    figure = Figure(figsize=(6, 4.8), layout="constrained")
    scatter_embedding(figure.subplots(), embedding, mass)
    figure.savefig(path, dpi=130)

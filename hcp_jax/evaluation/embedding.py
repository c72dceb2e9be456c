"""What a learned embedding says about the hardware behind it (paper, figure 4c)."""

import pathlib

import numpy as np
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


def plot_embedding(embedding: np.ndarray, mass: np.ndarray, path: pathlib.Path) -> None:
    """Scatter of a 2-D embedding [N, 2], coloured by mass [N] in kg."""
    figure = Figure(figsize=(6, 4.8), layout="constrained")
    axes = figure.subplots()
    points = axes.scatter(*embedding.T, c=mass, s=10, cmap="viridis")
    figure.colorbar(points, label="torso mass [kg]")
    axes.set_xlabel("v_h[0]")
    axes.set_ylabel("v_h[1]")
    figure.savefig(path, dpi=130)

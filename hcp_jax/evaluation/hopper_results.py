"""What is published of the hopper: tables, curves and pictures from run folders."""

import pathlib
from collections.abc import Sequence

import numpy as np

from hcp_jax.evaluation.embedding import knn_r2, plot_embedding
from hcp_jax.evaluation.publishing import group_by_name, plot_groups, publish_runs
from hcp_jax.evaluation.statistics import write_json
from hcp_jax.evaluation.summary import read_curve, read_run_commit, steps_to_reach, summarise_runs
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.policy_file import load_policy
from hcp_jax.training.run_folder import read_config

LABEL = "return of one episode"


def collect_hoppers(folders: Sequence[pathlib.Path], results: pathlib.Path) -> list[str]:
    """Adds the hopper's run folders to `results`; returns a line for each thing written.

    Each run's metrics under `hopper/runs/` and its policy under `policies/`; from all runs there, `hopper/summary.json` (a row
    per algorithm), `hopper/curves.png`, and `hopper/finetune.json` and `.png` if there are runs of 100 new hoppers. If a run of
    `hopper_embedding` is added, `hopper/embedding.json` and `.png`.
    """
    out = results / "hopper"
    published = publish_runs(folders, out, results / "policies")
    written = [f"{out}/runs, {results}/policies: {', '.join(folder.name for folder in folders)}"]
    by_name = group_by_name(published)
    new_robots = [folder for folder in published if read_config(folder).pool.split == "new"]
    main = {name: group for name, group in by_name.items() if name != "hopper_embedding" and group[0] not in new_robots}
    if main:
        write_json(out / "summary.json", summarise_runs([folder for group in main.values() for folder in group]))
        plot_groups(main, out / "curves.png", ("train_return_mean", "heldout_return_mean"), LABEL)
        written.append(f"{out}/summary.json, {out}/curves.png: {', '.join(main)}")
    if new_robots:
        written.append(write_finetune(new_robots, out))
    for folder in group_by_name(folders).get("hopper_embedding", ())[:1]:
        written.append(write_embedding(folder, out))
    return written


def write_finetune(folders: Sequence[pathlib.Path], out: pathlib.Path) -> str:
    """Steps at which runs from a pretrained one reach the final return of the run from scratch of the same seed."""
    configs = {folder: read_config(folder) for folder in folders}
    scratch = {config.seed: folder for folder, config in configs.items() if not config.init}
    if not scratch:
        return "no run from scratch to compare fine-tuning with"
    groups: dict[str, list[pathlib.Path]] = {"from scratch": list(scratch.values())}
    rows = []
    for folder, config in configs.items():
        if not config.init or config.seed not in scratch:
            continue
        groups.setdefault(f"pretrained, {config.init_layers} layers", []).append(folder)
        goal, curve = read_curve(scratch[config.seed], "train_return_mean")[-1], read_curve(folder, "train_return_mean")
        rows.append(
            {
                "run": folder.name,
                "seed": config.seed,
                "init_layers": config.init_layers,
                "scratch_final_return": round(float(goal[1]), 1),
                "scratch_env_steps": int(goal[0]),
                "pretrained_env_steps": int(curve[-1, 0]),
                "pretrained_final_return": round(float(curve[-1, 1]), 1),
                "pretrained_steps_to_scratch_final": steps_to_reach(folder, "train_return_mean", goal[1]),
                "commit": read_run_commit(folder),
            }
        )
    write_json(out / "finetune.json", rows)
    plot_groups(groups, out / "finetune.png", ("train_return_mean",), LABEL)
    return f"{out}/finetune.json, {out}/finetune.png: {rows}"


def write_embedding(folder: pathlib.Path, out: pathlib.Path) -> str:
    """R^2 of the torso mass [kg] from the 2-D embedding, both for each hopper, and their scatter plot."""
    run = make_experiment(read_config(folder))
    iteration, state = load_policy(folder, run)
    embedding, mass = np.asarray(state.params["embedding"]), run.train_pool.hardware["body_mass"][:, 0]
    record = {
        "run": folder.name,
        "env_steps": iteration * run.config.batch_size,
        "neighbours": 5,
        "folds": 5,
        "r2": round(knn_r2(embedding, mass), 4),
        "embedding": np.round(embedding.astype(np.float64), 4).tolist(),
        "torso_mass": np.round(mass, 4).tolist(),
        "commit": read_run_commit(folder),
    }
    write_json(out / "embedding.json", record)
    plot_embedding(embedding, mass, out / "embedding.png")
    return f"{out}/embedding.json, {out}/embedding.png: R^2 {record['r2']}"

"""What is published of the hopper: tables, curves and pictures from run folders."""

import itertools
import pathlib
from collections.abc import Sequence

import numpy as np

from hcp_jax.config import Config
from hcp_jax.evaluation.embedding import knn_r2, plot_embedding
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.groups import group_by_settings, group_folders, label_groups
from hcp_jax.evaluation.publishing import plot_groups, publish_runs
from hcp_jax.evaluation.summary import read_curve, read_run_commit, steps_to_reach, summarise_runs
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.policy_file import load_policy
from hcp_jax.training.run_folder import read_config

LABEL = "return of one episode"


def collect_hoppers(folders: Sequence[pathlib.Path], results: pathlib.Path) -> list[str]:
    """Adds the hopper's run folders, which may be none, to `results`; returns a line for each thing written.

    Each run's metrics under `hopper/runs/` and its policy under `policies/`; from all runs there, `hopper/summary.json` (a row
    per algorithm), `hopper/curves.png`, `hopper/finetune.json` and `.png` if there are runs of 100 new hoppers, and
    `hopper/embedding.json` and `.png` if there is one of `hopper_embedding`.
    """
    out, policies = results / "hopper", results / "policies"
    published, written = publish_runs(folders, out, policies)
    configs = {folder: read_config(folder) for folder in published}
    new_robots = [folder for folder, config in configs.items() if config.pool.split == "new"]
    embeddings = [folder for folder, config in configs.items() if is_of_embedding(config)]
    main = [folder for folder in published if folder not in (*new_robots, *embeddings)]
    if main:
        groups = group_folders(main)
        write_json(out / "summary.json", summarise_runs(main))
        plot_groups(groups, out / "curves.png", ("train_return_mean", "heldout_return_mean"), LABEL)
        written.append(f"{out}/summary.json, {out}/curves.png: {', '.join(groups)}")
    if new_robots:
        written.append(write_finetune(new_robots, out))
    if embeddings:
        written.append(write_embedding(policies / embeddings[0].name, out))
    return written


def is_of_embedding(config: Config) -> bool:
    """Whether a run is one of `hopper_embedding`, whose v_h are points in a plane."""
    return (config.name, config.encoding, config.embedding.size) == ("hopper_embedding", "embedding", 2)


def write_finetune(folders: Sequence[pathlib.Path], out: pathlib.Path) -> str:
    """Steps at which runs from a pretrained one reach the final return of each run from scratch of the same seed."""
    configs = {folder: read_config(folder) for folder in folders}
    scratch = [folder for folder, config in configs.items() if not config.init]
    if not scratch:
        return "no run from scratch to compare fine-tuning with"
    rows = []
    for from_scratch, folder in itertools.product(scratch, folders):
        config = configs[folder]
        if not config.init or config.seed != configs[from_scratch].seed:
            continue
        goal, curve = read_curve(from_scratch, "train_return_mean")[-1], read_curve(folder, "train_return_mean")
        rows.append(
            {
                "run": folder.name,
                "scratch_run": from_scratch.name,
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
    groups = group_by_settings([*scratch, *(folder for folder in folders if folder not in scratch)], configs.__getitem__)
    starts = [name_start(configs[group[0]]) for group in groups]
    labels = label_groups(starts, [[folder.name for folder in group] for group in groups])
    write_json(out / "finetune.json", rows)
    plot_groups(dict(zip(labels, groups, strict=True)), out / "finetune.png", ("train_return_mean",), LABEL)
    return f"{out}/finetune.json, {out}/finetune.png: {rows}"


def name_start(config: Config) -> str:
    """Where a run of new hoppers starts from."""
    return f"pretrained, {config.init_layers} layers" if config.init else "from scratch"


def write_embedding(folder: pathlib.Path, out: pathlib.Path) -> str:
    """R^2 of the torso mass [kg] from the 2-D embedding, both for each hopper, and their scatter plot."""
    run = make_experiment(read_config(folder))
    iteration, state = load_policy(folder, run)
    embedding, mass = np.asarray(state.params["embedding"]), run.train_pool.hardware["body_mass"][:, 0]
    record = {
        "run": folder.name,
        "env_steps": iteration * run.config.steps_per_iteration,
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

"""The hopper: learning curves, new hoppers, and the learned embedding."""

import pathlib

import numpy as np

from hcp_jax.evaluation.embedding import scatter_embedding
from hcp_jax.evaluation.files import naming, number, optional_number, read_json
from hcp_jax.evaluation.groups import label_groups
from hcp_jax.evaluation.hopper_results import name_start
from hcp_jax.evaluation.summary import RETURNS, deviation_over_seeds
from hcp_jax.reporting.curves import SPREAD, draw_groups
from hcp_jax.reporting.page import Figure, Item, Row, Section, Table
from hcp_jax.reporting.plots import render
from hcp_jax.reporting.published import Published

LABEL = "return of one episode"
KINDS = {
    "train_return": "robots trained on",
    "heldout_return": "held-out robots",
    "heldout_fitted_return": "held-out robots, v_h fitted",
}
FIRST = "heldout_first_"
COLLECT_COMMAND = "python -m hcp_jax.collect runs/hopper --out results"


def hopper_section(published: Published) -> Section:
    """Everything of the hopper. The paper gives no numbers of it, only figures."""
    return Section(
        "hopper",
        "Hopper",
        (make_performance(published), make_first_steps(published), make_new_hoppers(published), make_embedding(published)),
        f"The paper shows these as figures without numbers, so there are none to set beside ours. {SPREAD}",
    )


def make_performance(published: Published) -> Item:
    """A row for each algorithm, and its curves."""
    path = published.find("hopper/summary.json")
    tables = tabulate_performance(path, published.show(path)) if path else ()
    hoppers = [run.config for run in published.hoppers]
    names = [config.name for config in hoppers if config.pool.split != "new" and config.name != "hopper_embedding"]
    groups = published.runs_of(list(dict.fromkeys(names)))
    figures = [
        draw_groups(published, groups, f"{kind}_mean", f"{text.capitalize()}.", LABEL, None) for kind, text in KINDS.items()
    ]
    commands = ("python -m hcp_jax.sweep experiments/hopper_curves.py --seeds 3 --out runs/hopper", COLLECT_COMMAND)
    return Item("Learning curves", "", tables, tuple(figure for figure in figures if figure), commands)


def tabulate_performance(path: pathlib.Path, shown: str) -> tuple[Table, ...]:
    """The table of a summary, called `shown`; none without rows."""
    rows = []
    for row, name in name_rows(path):
        with naming(path):
            returns = [show_return(row[f"{kind}_mean"], row[f"{kind}_std"]) for kind in RETURNS]
            steps, minutes = f"{number(row['env_steps']) / 1e6:.2f}", f"{number(row['wall_seconds']) / 60:.0f}"
            seeds = str(len(row["seeds"]))
            rows.append(Row((str(row["algorithm"]), str(row["encoding"]), name, *returns, seeds, steps, minutes)))
    columns = ("algorithm", "v_h", "experiment", *KINDS.values(), "seeds", "control steps [M]", "minutes")
    caption = "Return at the end: mean and sample standard deviation over seeds"
    return (Table(caption, columns, "llcrrrrrr", tuple(rows), (shown,)),) if rows else ()


def name_rows(path: pathlib.Path) -> list[tuple[dict, str]]:
    """The rows of a summary, each with its experiment's name, and its runs where rows share the name."""
    rows = read_json(path, list)
    with naming(path):
        labels = label_groups([str(row["name"]) for row in rows], [[str(name) for name in row["runs"]] for row in rows])
        return list(zip(rows, labels, strict=True))


def make_first_steps(published: Published) -> Item:
    """What HCP-I is worth on a hopper that it never saw, by how much the hopper has shown of itself."""
    folder = published.find("hopper/evaluations")
    paths, returns = sorted(folder.glob("*_first_steps.json")) if folder else [], {}
    for path in paths:
        with naming(path):
            record = read_json(path, dict)
            experiment = pathlib.PurePath(record["run"]).name.rpartition("_s")[0]
            for name, outcome in record["sets"].items():
                returns.setdefault((experiment, name_set(name)), []).append(number(outcome["return_mean"]))
    rows = tuple(
        Row((steps, show_return(np.mean(values), deviation_over_seeds(values)), str(len(values)), experiment))
        for (experiment, steps), values in returns.items()
    )
    caption = "Return of one episode: mean and sample standard deviation over seeds"
    columns = ("v_h from", "return", "seeds", "experiment")
    tables = (Table(caption, columns, "lrrc", rows, tuple(published.show(path) for path in paths)),) if rows else ()
    text = (
        "Hoppers that the policy never saw, networks frozen. v_h is the one with which the forward model best predicts "
        "a hopper's own first control steps (8 ms each), or the mean of those trained on, or what those learned."
    )
    command = (
        "python -m hcp_jax.evaluate results/policies/hopper_hcpi_s0 --trials 1 --fit-steps 0 --first-steps 10 50 200 1000 "
        "--without-robots --json results/hopper/evaluations/hopper_hcpi_s0_first_steps.json"
    )
    return Item("New hoppers, from their first steps", text, tables, (), (command,))


def name_set(name: str) -> str:
    """What the hoppers of a record's set know of themselves."""
    if name.startswith(FIRST):
        return f"{int(name.removeprefix(FIRST)):,} control steps of its own"
    names = {"train": "training (robots trained on)", "heldout": "nothing: the mean", "heldout_fitted": "a fit with its policy"}
    return names[name]


def make_new_hoppers(published: Published) -> Item:
    """100 new hoppers: from another policy and from scratch."""
    path = published.find("hopper/finetune.json")
    tables = tabulate_new_hoppers(path, published.show(path)) if path else ()
    names = dict.fromkeys(run.config.name for run in published.hoppers if run.config.pool.split == "new")
    groups, caption = published.runs_of(list(names)), "The 100 new hoppers."
    figure = draw_groups(published, groups, "train_return_mean", caption, LABEL, None, name_start)
    train = "python -m hcp_jax.train --config experiments"
    commands = (
        f"{train}/hopper_finetune_scratch.py --out runs/hopper/hopper_finetune_scratch_s0",
        f"{train}/hopper_finetune_hidden.py --out runs/hopper/hopper_finetune_hidden_s0",
        f"{train}/hopper_finetune.py --out runs/hopper/hopper_finetune_s0",
        COLLECT_COMMAND,
    )
    return Item("Transfer to 100 new hoppers", "", tables, (figure,) if figure else (), commands)


def tabulate_new_hoppers(path: pathlib.Path, shown: str) -> tuple[Table, ...]:
    """The table of what `collect` wrote of fine-tuned runs, called `shown`; none without rows."""
    rows = []
    for row in read_json(path, list):
        with naming(path):
            goal, reached = number(row["scratch_env_steps"]), optional_number(row["pretrained_steps_to_scratch_final"])
            cells = (
                str(row["run"]),
                str(row["init_layers"]),
                f"{number(row['scratch_final_return']):.1f}",
                f"{goal / 1e6:.2f}",
                "not reached" if reached is None else f"{reached / 1e6:.2f}",
                "" if reached is None else f"{100 * reached / goal:.1f}",
                f"{number(row['pretrained_final_return']):.1f}",
            )
            rows.append(Row(cells))
    columns = ("run", "layers", "from scratch, in the end", "after [M steps]", "pretrained there after [M steps]")
    columns += ("share of steps [%]", "pretrained, in the end")
    caption = "Steps to the return of a training from scratch"
    return (Table(caption, columns, "clrrrrr", tuple(rows), (shown,)),) if rows else ()


def make_embedding(published: Published) -> Item:
    """The learned v_h of hoppers that differ in torso mass alone."""
    path = published.find("hopper/embedding.json")
    figures, text = (), "Hoppers that differ in torso mass alone, each with two learned numbers."
    if path:
        record = read_json(path, dict)
        with naming(path):
            points = np.asarray([[number(value) for value in row] for row in record["embedding"]]).reshape(-1, 2)
            mass = np.asarray([number(value) for value in record["torso_mass"]])
            if len(points) != len(mass):
                raise ValueError(f"{len(points)} rows of embedding, {len(mass)} of torso_mass")
            r2 = f"R\N{SUPERSCRIPT TWO} {number(record['r2']):.4f}, cross-validated"
            text += f" The mean mass of the {int(record['neighbours'])} nearest others predicts the mass with {r2}."
        picture = render(lambda axes: scatter_embedding(axes, points, mass), (5.0, 3.9))
        figures = (Figure(picture, f"Each of {len(points)} dots is a hopper.", (published.show(path),)),)
    train = "python -m hcp_jax.train --config experiments/hopper_embedding.py --out runs/hopper/hopper_embedding_s0"
    return Item("Embedding", text, (), figures, (train, COLLECT_COMMAND))


def show_return(mean: object, deviation: object) -> str:
    """`5405.8 ± 142.3`, the mean alone of one seed, or nothing for what an algorithm does not have."""
    if mean is None or deviation is None:
        return "" if mean is None else f"{number(mean):.1f}"
    return f"{number(mean):.1f} \N{PLUS-MINUS SIGN} {number(deviation):.1f}"

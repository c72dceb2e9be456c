"""Distributions over arms: how near they come to their goals and how long they take, for new types and for other damping."""

from collections.abc import Callable

import numpy as np

from hcp_jax.evaluation.appendix import PAPER_DAMPING, make_damping
from hcp_jax.evaluation.records import Evaluation, Outcome, read_evaluation
from hcp_jax.reporting.curves import make_curves
from hcp_jax.reporting.page import Figure, Item, Row, Section, Table
from hcp_jax.reporting.plots import Spread, draw_spreads
from hcp_jax.reporting.published import Published, Run
from hcp_jax.reporting.settings import EVALUATE_COMMAND, RESULTS_COMMANDS, SETTINGS, TASKS, roman
from hcp_jax.reporting.tables import NOT_RUN, capitalise, decimals, difference, spread

QUANTILES = (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)  # that every record of arms has
DISTANCE = "final distance [m]"
SUCCESS_DISTANCE = (0.02, "success: 0.02 m")
STRESSED = "peg_low_damping_ddpg"  # trained at damping 0.01 to 2
VIOLINS = "Violins with lowest value, median and highest value."
BOXES = (
    "Boxes, where a record holds quantiles alone: 25 to 75 %, median, whiskers from the lowest value to 95 %, ring: highest."
)


def distance_section(published: Published) -> Section:
    """Final distances on the type left out, HCP-E against DDPG+HER."""
    return Section(
        "distances",
        "Final distance on the type left out",
        tuple(make_distances(published, task) for task in TASKS),
        "Distance of the reacher's end effector, or of the peg's bottom, from its goal at the end of an episode, one for each "
        f"arm of the type left out. The paper shows Exp. XI, XII, XV and XVI. {VIOLINS} {BOXES}",
    )


def make_distances(published: Published, task: str) -> Item:
    """One panel: every evaluated policy of the task's experiments."""
    spreads, files = [], []
    folder = published.folder / "arms" / "evaluations"
    for setting in SETTINGS:
        runs = {run.folder.name: run for run in published.arms if setting.trains(run.config.name)}
        for name in sorted(runs, key=lambda name: (rank(runs[name]), name)):
            if setting.task != task or not (folder / f"{name}.json").exists():
                continue
            evaluation, config = read_evaluation(folder / f"{name}.json"), runs[name].config
            outcome = evaluation.types.get(setting.left_out)
            if outcome is None:
                continue
            is_control = config.encoding.startswith("none+")
            number = setting.experiment + (config.encoding == "none")
            first = "control" if is_control else f"Exp. {roman(number)}"
            inputs = "DDPG+HER" if config.encoding == "none" else config.encoding.replace("+", "+\n")
            label = f"{first}\n{inputs}\nseed {config.seed}"
            spreads.append(spread_of(label, evaluation.encoding, outcome, outcome.final_distances))
            files.append(published.show(evaluation.path))
    figures = ()
    if spreads:
        figures = (Figure(draw_spreads(spreads, DISTANCE, SUCCESS_DISTANCE), describe_kinds(spreads), tuple(files)),)
    names = [s.experiment_name(algorithm) for s in SETTINGS if s.task == task for algorithm in ("hcpe", "ddpg")]
    missing = [name for name in names if f"arms/evaluations/{name}_s" not in " ".join(files)]
    text = f"Not evaluated: {', '.join(missing)}." if missing and figures else ""
    commands = (*RESULTS_COMMANDS, EVALUATE_COMMAND.format(name="POLICY"))
    return Item(capitalise(task), text, figures=figures, commands=commands)


def damping_section(published: Published) -> Section:
    """The stress test: a policy of weakly damped arms on arms of ever stronger damping."""
    return Section(
        "damping",
        "Stress test: damping beyond the training's",
        (make_damping_item(published), make_curves(published, "Its training", [STRESSED])),
        "Peg insertion by DDPG+HER without v_h, trained on arms of type I with damping from 0.01 to 2 N m s/rad, on 100 arms "
        "of each range.",
    )


def make_damping_item(published: Published) -> Item:
    """The table with the paper's figures, and distance and episode length over ranges."""
    folder = published.find("arms/damping")
    rows = make_damping(published.folder) if folder else []
    evaluations = [read_evaluation(path) for path in dict.fromkeys(row["record"] for row in rows)]
    files = tuple(published.show(evaluation.path) for evaluation in evaluations)
    lines = []
    for row in rows:
        cells = (
            f"{row['damping_low']:g} to {row['damping_high']:g}",
            row["test_type"],
            spread(row["success_mean"], row["success_std_over_trials"] if row["trials"] > 1 else None),
            decimals(row["paper_mean"]),
            difference(row["success_mean"], row["paper_mean"]),
            f"{row['episode_length_mean']:.1f}",
            str(row["trials"] * row["robots_per_trial"]),
            row["policy"],
        )
        lines.append(Row(cells))
    for (low, high), success in PAPER_DAMPING.items():
        if rows and not any((row["damping_low"], row["damping_high"]) == (low, high) for row in rows):
            lines.append(Row((f"{low:g} to {high:g}", "", NOT_RUN, decimals(success), "", "", "", ""), "missing"))
    columns = ("damping [N m s/rad]", "type", "ours [%]", "paper [%]", "difference", "mean episode length [steps]", "arms")
    tables = (Table("Success by range of damping", (*columns, "policy"), "llrrrrrc", tuple(lines), files),) if rows else ()
    figures = tuple(
        figure
        for label, take in (
            (DISTANCE, lambda outcome: outcome.final_distances),
            ("episode length [control steps]", lambda outcome: outcome.episode_lengths),
        )
        if (figure := draw_damping(evaluations, label, take, files)) is not None
    )
    commands = [
        f"python -m hcp_jax.train --config experiments/{STRESSED}.py --out runs/arms/{STRESSED}_s0",
        RESULTS_COMMANDS[1],
    ]
    for low, high in PAPER_DAMPING:
        commands.append(
            f"python -m hcp_jax.evaluate results/policies/{STRESSED}_s0 --trials 1 --range damping {low:g} {high:g} "
            f"--without-robots --json results/arms/damping/{STRESSED}_s0_{low:g}_{high:g}.json"
        )
    return Item("Success, distance and episode length", "", tables, figures, tuple(commands))


def draw_damping(
    evaluations: list[Evaluation], label: str, take: Callable[[Outcome], np.ndarray | None], files: tuple[str, ...]
) -> Figure | None:
    """A distribution for each record and type; None where no record holds any."""
    several = len({evaluation.policy for evaluation in evaluations}) > 1
    spreads = []
    for evaluation in evaluations:
        low, high = evaluation.ranges["damping"]
        for outcome in evaluation.types.values():
            place = f"{low:g} to {high:g}" + f"\n{evaluation.policy.rpartition('_')[2]}" * several
            spreads.append(spread_of(place, evaluation.encoding, outcome, take(outcome)))
    if label != DISTANCE:  # records without single episodes have quantiles of the distance alone
        spreads = [spread for spread in spreads if spread.values is not None]
    if not spreads:
        return None
    mark = SUCCESS_DISTANCE if label == DISTANCE else None
    return Figure(draw_spreads(spreads, label, mark), f"Over damping [N m s/rad]. {describe_kinds(spreads)}", files)


def rank(run: Run) -> int:
    """HCP-E first, then the baseline, then controls."""
    encoding = run.config.encoding
    return encoding.startswith("none") + encoding.startswith("none+")


def spread_of(label: str, encoding: str, outcome: Outcome, values: np.ndarray | None) -> Spread:
    return Spread(label, encoding, values, tuple(outcome.distance_quantiles[q] for q in QUANTILES))


def describe_kinds(spreads: list[Spread]) -> str:
    """Whether a figure shows violins, boxes or both."""
    kinds = {spread.values is None for spread in spreads}
    return {(True,): BOXES, (False,): VIOLINS}.get(tuple(kinds), f"{VIOLINS} {BOXES}")

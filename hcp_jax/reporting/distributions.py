"""Distributions over arms: how near they come to their goals and how long they take, for new types and for other damping."""

from collections.abc import Callable, Sequence

import numpy as np

from hcp_jax.config import ArmConfig
from hcp_jax.evaluation.appendix import PAPER_DAMPING
from hcp_jax.evaluation.files import naming
from hcp_jax.evaluation.records import Evaluation, Outcome, read_evaluation
from hcp_jax.evaluation.summary import name_algorithm
from hcp_jax.reporting.curves import make_curves, train_commands
from hcp_jax.reporting.page import Figure, Item, Row, Section, Table
from hcp_jax.reporting.plots import Spread, draw_spreads
from hcp_jax.reporting.published import Published, Run
from hcp_jax.reporting.settings import EVALUATE_COMMAND, RESULTS_COMMANDS, SETTINGS, TASKS, name_inputs, roman
from hcp_jax.reporting.tables import NOT_RUN, capitalise, decimals, difference, spread

DISTANCE = "final distance [m]"
SUCCESS_DISTANCE = (0.02, "success: 0.02 m")
STRESSED = ("peg_low_damping_ddpg", "peg_low_damping_film")  # trained at damping 0.01 to 2; the paper's and HCP-E
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
    spreads, files, shown = [], [], set()
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
            assert isinstance(config.env, ArmConfig)
            inputs = name_inputs(config.encoding, config.env.joint_slots, config.ddpg.network)
            inputs = "DDPG+HER" if config.encoding == "none" else inputs.replace("+", "+\n").replace(", ", ",\n")
            label = f"{first}\n{inputs}\nseed {config.seed}"
            spreads.append(spread_of(label, evaluation.encoding, outcome, outcome.final_distances))
            files.append(published.show(evaluation.path))
            shown.add(config.name)
    figures = ()
    if spreads:
        figures = (Figure(draw_spreads(spreads, DISTANCE, SUCCESS_DISTANCE), describe_kinds(spreads), tuple(files)),)
    names = [name for setting in SETTINGS if setting.task == task for name in setting.experiment_names]
    missing = [name for name in names if name not in shown]
    text = f"Not evaluated: {', '.join(missing)}." if missing and figures else ""
    commands = (*RESULTS_COMMANDS, EVALUATE_COMMAND.format(name="POLICY"))
    return Item(capitalise(task), text, figures=figures, commands=commands)


def damping_section(published: Published) -> Section:
    """The stress test: policies of weakly damped arms on arms of ever stronger damping."""
    return Section(
        "damping",
        "Stress test: damping beyond the training's",
        (make_damping_item(published), make_curves(published, "Their training", STRESSED)),
        "Peg insertion with arms of type I, trained at damping from 0.01 to 2 N m s/rad, on 100 arms of each range: DDPG+HER "
        "without v_h, as in the paper, and HCP-E, which sees the arm's kinematics and nothing of its dynamics.",
    )


def make_damping_item(published: Published) -> Item:
    """The table with the paper's figures, and distance and episode length over ranges."""
    records = read_damping(published)
    files = tuple(published.show(evaluation.path) for _, evaluation in records)
    lines = []
    for damping in sorted({*PAPER_DAMPING, *(damping for damping, _ in records)}):
        evaluations = [evaluation for of_record, evaluation in records if of_record == damping]
        if damping in PAPER_DAMPING and not any(evaluation.encoding == "none" for evaluation in evaluations):
            cells = (name_range(damping), "DDPG+HER", "I", NOT_RUN, decimals(PAPER_DAMPING[damping]), "", "", "", "")
            lines.append(Row(cells, "missing"))
        lines += [line for evaluation in evaluations for line in damping_lines(damping, evaluation)]
    columns = ("damping [N m s/rad]", "algorithm", "type", "ours [%]", "paper [%]", "difference")
    columns += ("mean episode length [steps]", "arms", "policy")
    tables = (Table("Success by range of damping", columns, "lllrrrrrc", tuple(lines), files),)
    figures = tuple(
        figure
        for label, take in (
            (DISTANCE, lambda outcome: outcome.final_distances),
            ("episode length [control steps]", lambda outcome: outcome.episode_lengths),
        )
        if (figure := draw_damping(records, label, take, files)) is not None
    )
    evaluate = tuple(
        f"python -m hcp_jax.evaluate results/policies/{name}_s0 --trials 1 --range damping {low:g} {high:g} "
        f"--without-robots --json results/arms/damping/{name}_s0_{low:g}_{high:g}.json"
        for name in STRESSED
        for low, high in PAPER_DAMPING
    )
    commands = (*train_commands(STRESSED), RESULTS_COMMANDS[1], *evaluate)
    return Item("Success, distance and episode length", "", tables, figures, commands)


def read_damping(published: Published) -> list[tuple[tuple[float, float], Evaluation]]:
    """The records in `arms/damping`, with their range, by range. Raises RecordError if one has no range of damping."""
    folder = published.find("arms/damping")
    records = []
    for path in sorted(folder.glob("*.json")) if folder else ():
        evaluation = read_evaluation(path)
        with naming(path):
            records.append((evaluation.ranges["damping"], evaluation))
    return sorted(records, key=lambda record: record[0])


def name_range(damping: tuple[float, float]) -> str:
    return f"{damping[0]:g} to {damping[1]:g}"


def damping_lines(damping: tuple[float, float], evaluation: Evaluation) -> list[Row]:
    """A row for each type of a record, beside the paper's where it is of the paper's algorithm."""
    lines, paper = [], PAPER_DAMPING.get(damping) if evaluation.encoding == "none" else None
    for robot_type, outcome in evaluation.types.items():
        cells = (
            name_range(damping),
            name_algorithm("ddpg", evaluation.encoding),
            robot_type,
            spread(outcome.success_mean, outcome.success_std if evaluation.trials > 1 else None),
            decimals(paper),
            difference(outcome.success_mean, paper),
            f"{outcome.episode_length_mean:.1f}",
            str(evaluation.trials * evaluation.robots_per_trial),
            evaluation.policy,
        )
        lines.append(Row(cells))
    return lines


def draw_damping(
    records: Sequence[tuple[tuple[float, float], Evaluation]],
    label: str,
    take: Callable[[Outcome], np.ndarray | None],
    files: tuple[str, ...],
) -> Figure | None:
    """A distribution for each record and type; None where no record holds any."""
    several = len({evaluation.policy for _, evaluation in records}) > 1
    spreads = []
    for damping, evaluation in records:
        for outcome in evaluation.types.values():
            algorithm, seed = name_algorithm("ddpg", evaluation.encoding), evaluation.policy.rpartition("_")[2]
            place = name_range(damping) + f"\n{algorithm}\n{seed}" * several
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
    return Spread(label, encoding, values, outcome.distance_quantiles)


def describe_kinds(spreads: list[Spread]) -> str:
    """Whether a figure shows violins, boxes or both."""
    kinds = {spread.values is None for spread in spreads}
    if len(kinds) != 1:
        return f"{VIOLINS} {BOXES}"
    return BOXES if kinds == {True} else VIOLINS

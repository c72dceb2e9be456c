"""The paper's tables beside ours."""

from collections.abc import Iterable, Sequence

from hcp_jax.evaluation.appendix import PAPER_OTHER_ARMS, PAPER_TYPES, paper_by_type
from hcp_jax.evaluation.records import TableRow
from hcp_jax.evaluation.summary import read_curve
from hcp_jax.hardware.arm import OTHER_ARMS
from hcp_jax.reporting.page import Item, Row, Section, Table
from hcp_jax.reporting.published import Published
from hcp_jax.reporting.settings import (
    EVALUATE_COMMAND,
    LISTED_COMMAND,
    RESULTS_COMMANDS,
    SETTINGS,
    TABLES_COMMAND,
    TASKS,
    Setting,
    name_inputs,
    roman,
)

COMMANDS = (*RESULTS_COMMANDS, EVALUATE_COMMAND.format(name="POLICY"), TABLES_COMMAND)
ALGORITHMS = ("HCP-E", "DDPG+HER")  # of the paper's pairs
# What a phone shows without scrolling comes first.
MEASUREMENTS = (
    "ours [%]",
    "paper [%]",
    "difference",
    "algorithm",
    "v_h",
    "trained on",
    "seeds",
    "std over seeds",
    "of reachable goals [%]",
    "control steps [M]",
    "minutes",
)
NOT_RUN, NOT_EVALUATED = "not run", "not evaluated"


def table_sections(published: Published) -> tuple[Section, ...]:
    """Table 1 with our controls, and the appendix's tables by type."""
    rows, by_type = published.table("table1.json"), published.table("appendix.json")
    table1 = Section(
        "table1",
        "Table 1: zero-shot success on a type that was not trained on",
        (make_table1(published, rows), make_controls(published, rows)),
        "Success in percent on new arms of the type left out: mean and standard deviation over trials of 100 arms, then "
        "averaged over seeds. A goal counts as reachable if inverse kinematics within joint limits finds joint angles for it.",
    )
    appendix = Section(
        "types",
        "Appendix tables: success on the types trained on",
        (*(make_types(published, by_type, task) for task in TASKS), make_other_arms(published, by_type)),
        "New arms of the types trained on, and arms of two other templates. The paper heads the columns of Exp. VII and VIII A "
        "to G and I, though these left E out; here they are read in order, as A to D and F to I.",
    )
    return table1, appendix


def make_table1(published: Published, rows: Sequence[TableRow]) -> Item:
    """The sixteen experiments in the paper's order; an experiment with several v_h has a row for each."""
    columns = ("Exp.", "tested on", *MEASUREMENTS)
    lines: dict[str, list[Row]] = {task: [] for task in TASKS}
    for setting in SETTINGS:
        trained = letters(name for name in PAPER_TYPES if name != setting.left_out)
        for number, (algorithm, name) in enumerate(zip(ALGORITHMS, setting.experiment_names, strict=True)):
            experiment = setting.experiment + number
            first = (roman(experiment), setting.left_out)
            measured = [row for row in rows if row.experiment == experiment]
            measured.sort(key=lambda row: not row.policy[0].startswith(name))  # first the one that table1.py lists
            lines[setting.task] += [Row((*first, *measurements(row))) for row in measured]
            if not measured:
                steps = describe_progress(published, name)
                state = NOT_EVALUATED if steps else NOT_RUN
                cells = (state, spread(*setting.paper[number]), "", algorithm, "", trained, "", "", "", steps, "")
                command = f"python -m hcp_jax.train --config experiments/{name}.py"
                lines[setting.task].append(Row((*first, *cells, command), "missing"))
    files = source(published, rows, "table1.json")
    tables = tuple(
        Table(capitalise(task), (*columns, "policies, or training"), "llrrrlllrrrrrc", tuple(lines[task]), files)
        for task in TASKS
    )
    text = "Minutes are the time of one training. The record of a policy is results/arms/evaluations/POLICY.json."
    return Item("Sixteen experiments", text, tables, commands=COMMANDS)


def make_controls(published: Published, rows: Sequence[TableRow]) -> Item:
    """Ours alone: what the end effector's position explains without any hardware."""
    columns = ("task", "tested on", *MEASUREMENTS)
    lines = tuple(
        Row((row.task.replace("_", " "), row.test_type, *measurements(row))) for row in rows if row.experiment is None
    )
    files = source(published, rows, "table1.json")
    table = Table("Controls", (*columns, "policies"), "llrrrlllrrrrrc", lines, files)
    text = (
        "DDPG+HER that sees the end effector's position, or its offset from the goal, and no v_h: how much of the gain is the "
        "position rather than the hardware."
    )
    commands = (LISTED_COMMAND, *COMMANDS[1:])
    return Item("Controls, which the paper does not have", text, (table,) if lines else (), commands=commands)


def measurements(row: TableRow) -> tuple[str, ...]:
    """`MEASUREMENTS`, and the policies."""
    return (
        spread(row.success_mean, row.success_std_over_trials),
        spread(row.paper_mean, row.paper_std),
        difference(row.success_mean, row.paper_mean),
        row.algorithm,
        inputs_of(row),
        letters(row.train_types),
        str(len(row.seeds)),
        decimals(row.success_std_over_seeds),
        decimals(row.reachable_success_mean),
        f"{row.control_steps / 1e6:.2f}",
        f"{row.wall_seconds / 60:.0f}",
        ", ".join(row.policy),
    )


def make_types(published: Published, rows: Sequence[TableRow], task: str) -> Item:
    """A column for each type, and per experiment a line of ours, of the paper's and of the difference."""
    lines: list[Row] = []
    for setting in SETTINGS:
        if setting.task == task:
            for number, algorithm in enumerate(ALGORITHMS):
                lines += types_of_experiment(rows, setting, setting.experiment + number, algorithm)
    columns = ("Exp.", "algorithm", "v_h", "", *PAPER_TYPES)
    table = Table("Success [%] by type", columns, "llll" + "r" * 9, tuple(lines), source(published, rows, "appendix.json"))
    return Item(capitalise(task), "", (table,), commands=COMMANDS)


def types_of_experiment(rows: Sequence[TableRow], setting: Setting, experiment: int, algorithm: str) -> list[Row]:
    """One experiment's lines."""
    measured = [row for row in rows if row.experiment == experiment and row.test_type in PAPER_TYPES]
    paper = {letter: paper_by_type(experiment, setting.left_out, letter) for letter in PAPER_TYPES}
    shown = [spread(*of_type) if of_type else "left out" for of_type in paper.values()]
    lines = [Row((roman(experiment), algorithm, "", "paper", *shown), "paper")]
    for policies in dict.fromkeys(row.policy for row in measured):
        ours = {row.test_type: row for row in measured if row.policy == policies}
        first = (roman(experiment), algorithm, inputs_of(next(iter(ours.values()))))
        cells, differences = [], []
        for letter in PAPER_TYPES:
            row = ours.get(letter)
            cells.append(
                spread(row.success_mean, row.success_std_over_trials) if row else NOT_EVALUATED if paper[letter] else ""
            )
            differences.append(difference(row.success_mean, row.paper_mean) if row else "")
        lines += [Row((*first, "ours", *cells)), Row((*first, "difference", *differences), "difference")]
    if not measured:
        cells = [NOT_RUN if of_type else "" for of_type in paper.values()]
        lines.append(Row((roman(experiment), algorithm, "", "ours", *cells), "missing"))
    return lines


def make_other_arms(published: Published, rows: Sequence[TableRow]) -> Item:
    """Types J and K, which no experiment trains on."""
    columns = ("Exp.", "algorithm", "v_h", "type", "ours [%]", "paper [%]", "difference", "seeds", "policies")
    lines = []
    for letter in OTHER_ARMS:
        measured = [row for row in rows if row.test_type == letter]
        for row in measured:
            ours, paper, points, _, seeds = measurements(row)[:5]
            cells = (row.algorithm, inputs_of(row), letter, ours, paper, points, seeds, ", ".join(row.policy))
            lines.append(Row((roman(row.experiment), *cells)))
        for (experiment, of_type), paper in PAPER_OTHER_ARMS.items():
            if of_type == letter and not any(row.experiment == experiment for row in measured):
                cells = (letter, NOT_RUN, spread(*paper), "", "", "")
                lines.append(Row((roman(experiment), "HCP-E", "", *cells), "missing"))
    table = Table(
        "Success on other arms, peg insertion", columns, "llllrrrrc", tuple(lines), source(published, rows, "appendix.json")
    )
    text = "J is a 5-DOF arm without sideways offsets, K is Fetch. The paper tested K ten times."
    command = EVALUATE_COMMAND.format(name="POLICY") + " --types A B C D E F G H I J K"
    return Item("Types J and K", text, (table,), commands=(*RESULTS_COMMANDS, command, TABLES_COMMAND))


def describe_progress(published: Published, name: str) -> str:
    """The steps of a training that was not evaluated, of all that it was to have; nothing if there is none."""
    groups = published.runs_of([name])
    if not groups:
        return ""
    run = groups[0][0]
    curve = read_curve(run.folder, "train_types_success")
    done = curve[-1, 0] if len(curve) else 0.0
    return f"{done / 1e6:.2f} of {run.config.total_env_steps / 1e6:.2f}"


def source(published: Published, rows: Sequence[TableRow], name: str) -> tuple[str, ...]:
    return (published.show(published.folder / name),) if rows else ()


def inputs_of(row: TableRow) -> str:
    return name_inputs(row.encoding, row.joint_slots, row.network)


def letters(types: Iterable[str]) -> str:
    """`ABCDEFGI` as `A-G, I`."""
    groups: list[str] = []
    for letter in types:
        if groups and ord(letter) == ord(groups[-1][-1]) + 1:
            groups[-1] += letter
        else:
            groups.append(letter)
    return ", ".join(group if len(group) < 3 else f"{group[0]}-{group[-1]}" for group in groups)


def decimals(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def spread(mean: float | None, deviation: float | None) -> str:
    """`92.50 ± 1.96`; the mean alone without a deviation."""
    return decimals(mean) if mean is None or deviation is None else f"{mean:.2f} \N{PLUS-MINUS SIGN} {deviation:.2f}"


def difference(ours: float, paper: float | None) -> str:
    """In points, with its sign."""
    return "" if paper is None else f"{ours - paper:+.2f}".replace("-", "\N{MINUS SIGN}")


def capitalise(text: str) -> str:
    return text[0].upper() + text[1:]

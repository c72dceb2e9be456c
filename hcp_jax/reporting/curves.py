"""Learning curves of the arms, and what fine-tuning saves."""

from collections.abc import Callable, Sequence

import numpy as np

from hcp_jax.config import Config
from hcp_jax.evaluation.groups import label_groups
from hcp_jax.evaluation.summary import SeedCurve, name_algorithm
from hcp_jax.reporting.page import Figure, Item, Row, Section, Table
from hcp_jax.reporting.plots import Line, draw_curves
from hcp_jax.reporting.published import Published, Run, average_runs
from hcp_jax.reporting.settings import LISTED, LISTED_COMMAND, RESULTS_COMMANDS, SETTINGS, Setting, roman
from hcp_jax.reporting.tables import NOT_RUN
from hcp_jax.training.metrics import METRICS_FILE

SUCCESS = "train_types_success"
LEFT_OUT = "left_out_success"
TRAINING_ROBOTS = "training_robots_success"
LABEL = "success [%]"
LIMITS = (-2.0, 102.0)
SPREAD = "Lines are means over seeds, bands the range over seeds where there are several."
# Type left out with a random hole, and the experiment that goes on with that type: the paper's figure of fine-tuning.
FINE_TUNED = {"H": "random_peg_finetune_h", "I": "random_peg_finetune_i"}


def curve_sections(published: Published) -> tuple[Section, ...]:
    """Learning curves of the leave-one-out experiments, fine-tuning, and the appendix's curves of type I."""
    return (
        Section(
            "curves",
            "Learning curves: one type left out",
            tuple(make_leave_one_out(published, setting) for setting in SETTINGS),
            f"{SPREAD} Each point is one episode of each held-out arm.",
        ),
        Section(
            "finetuning",
            "Fine-tuning on the type left out",
            tuple(make_finetuning(published, letter, name) for letter, name in FINE_TUNED.items()),
            "Peg insertion with a random hole. HCP-E that never saw a type goes on with that type alone, beside the same "
            f"training from scratch. {SPREAD}",
        ),
        Section(
            "dynamics",
            "Arms of type I that differ in dynamics alone",
            tuple(
                make_curves(published, task, [f"{prefix}_only_dynamics_{inputs}" for inputs in ("ddpg", "dynamics", "random")])
                for prefix, task in (("reacher", "Reacher"), ("peg", "Peg insertion"))
            ),
            f"DDPG+HER without v_h, with the dynamics, and with as many random numbers. {SPREAD}",
        ),
        Section(
            "seven",
            "Arms of type I that differ in links and dynamics",
            tuple(
                make_curves(published, task, [f"{prefix}_7dof_{method}" for method in ("hcpi", "hcpe", "hcpe_dyn", "ddpg")])
                for prefix, task in (("reacher", "Reacher"), ("peg", "Peg insertion"))
            ),
            SPREAD,
        ),
    )


def make_leave_one_out(published: Published, setting: Setting) -> Item:
    """Two panels: held-out arms of the types trained on, and the type left out."""
    names = dict.fromkeys(run.config.name for run in published.arms if setting.trains(run.config.name))
    groups = published.runs_of(list(names))
    panels = ((SUCCESS, "New arms of the types trained on."), (LEFT_OUT, f"Type {setting.left_out}, zero-shot."))
    trained = setting.experiment_names
    return Item(
        setting.title,
        describe_missing(published, trained),
        figures=tuple(
            figure for column, caption in panels if (figure := draw_groups(published, groups, column, caption)) is not None
        ),
        commands=(*train_commands([*trained, *names]), RESULTS_COMMANDS[1]),
    )


def make_curves(published: Published, title: str, names: Sequence[str]) -> Item:
    """A panel of experiments by name, and one of those whose training robots have a learned v_h of their own."""
    groups = published.runs_of(names)
    panels = ((SUCCESS, "New arms of type I."), (TRAINING_ROBOTS, "Arms that were trained on, with the v_h that they learned."))
    figures = [draw_groups(published, groups, column, caption) for column, caption in panels]
    return Item(
        title,
        describe_missing(published, names),
        figures=tuple(figure for figure in figures if figure is not None),
        commands=(*train_commands(names), RESULTS_COMMANDS[1]),
    )


def make_finetuning(published: Published, letter: str, name: str) -> Item:
    """Runs that start from another one beside those from scratch, and the steps at which they reach what these end with."""
    scratch_name, lines, shown = f"{name}_scratch", [], []
    groups = published.runs_of([name, scratch_name])
    for runs in sorted(groups, key=lambda runs: bool(runs[0].config.init)):
        curve, is_pretrained = average_runs(runs, SUCCESS), bool(runs[0].config.init)
        if curve is not None:
            label = "from the policy that never saw the type" if is_pretrained else "from scratch"
            lines.append(Line(f"{label} ({curve.seeds})", "chain_fk" if is_pretrained else "none", curve))
            shown += metrics_of(published, runs)
    files = tuple(shown)
    figures = (Figure(draw_curves(lines, LABEL, LIMITS), f"New arms of type {letter}.", files),) if lines else ()
    is_pair = [line.encoding for line in lines] == ["none", "chain_fk"]
    tables = (compare_to_scratch(lines[0].curve, lines[1].curve, files),) if is_pair else ()
    commands = (*train_commands([name, scratch_name]), RESULTS_COMMANDS[1])
    experiment = next(s.experiment for s in SETTINGS if s.prefix == "random_peg" and s.left_out == letter)
    starts = dict.fromkeys(run.config.init for runs in groups for run in runs if run.config.init)
    text = f"From {', '.join(starts)}." if starts else ""
    return Item(f"Type {letter}, from Exp. {roman(experiment)}", text, tables, figures, commands)


def compare_to_scratch(scratch: SeedCurve, pretrained: SeedCurve, sources: tuple[str, ...]) -> Table:
    """When the pretrained runs' mean is at what the runs from scratch end with."""
    reached = np.flatnonzero(pretrained.mean >= scratch.mean[-1])
    steps = float(pretrained.steps[reached[0]]) if len(reached) else None
    cells = (
        f"{scratch.mean[-1]:.1f}",
        f"{scratch.steps[-1] / 1e6:.2f}",
        "not reached" if steps is None else f"{steps / 1e6:.2f}",
        "" if steps is None else f"{100 * steps / scratch.steps[-1]:.0f}",
        f"{pretrained.mean[-1]:.1f}",
    )
    columns = ("from scratch, in the end [%]", "after [M steps]", "pretrained there after [M steps]", "share of steps [%]")
    columns += ("pretrained, in the end [%]",)
    return Table("Steps to what a training from scratch ends with", columns, "rrrrr", (Row(cells),), sources)


def draw_groups(
    published: Published,
    groups: Sequence[Sequence[Run]],
    column: str,
    caption: str,
    label: str = LABEL,
    limits: tuple[float, float] | None = LIMITS,
    name: Callable[[Config], str] = lambda config: f"{name_algorithm(config.algorithm, config.encoding)}: {config.name}",
) -> Figure | None:
    """A panel with a line for each group of seeds that has the column; None if none has."""
    lines, files = [], []
    groups = sorted(groups, key=lambda runs: runs[0].config.encoding.startswith("none"))  # baselines below
    labels = label_groups([name(runs[0].config) for runs in groups], [[run.folder.name for run in runs] for runs in groups])
    for label_of_runs, runs in zip(labels, groups, strict=True):
        curve = average_runs(runs, column)
        if curve is not None:
            lines.append(Line(f"{label_of_runs} ({curve.seeds})", runs[0].config.encoding, curve))
            files += metrics_of(published, runs)
    return Figure(draw_curves(lines, label, limits), caption, tuple(files)) if lines else None


def metrics_of(published: Published, runs: Sequence[Run]) -> tuple[str, ...]:
    """The files of one experiment's runs, those of several seeds as one: `results/arms/runs/NAME{_s0,_s1}/metrics.csv`."""
    names, experiment = [run.folder.name for run in runs], runs[0].config.name
    if len(names) > 1 and all(name.startswith(experiment) for name in names):
        names = [f"{experiment}{{{','.join(name.removeprefix(experiment) for name in names)}}}"]
    return tuple(published.show(runs[0].folder.with_name(name) / METRICS_FILE) for name in names)


def train_commands(names: Sequence[str]) -> tuple[str, ...]:
    """The commands that train experiments with seed 0, each once."""
    train = "python -m hcp_jax.train --config experiments/{name}.py --out runs/arms/{name}_s0"
    return tuple(dict.fromkeys(LISTED_COMMAND if name in LISTED else train.format(name=name) for name in names))


def describe_missing(published: Published, names: Sequence[str]) -> str:
    """Which of several experiments have no run; nothing if none or all have."""
    missing = [name for name in names if not published.runs_of([name])]
    return f"{', '.join(missing)}: {NOT_RUN}." if 0 < len(missing) < len(names) else ""

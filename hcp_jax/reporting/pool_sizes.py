"""What more training robots bring to robots never seen, which the paper does not show."""

from collections.abc import Sequence

import numpy as np

from hcp_jax.config import ArmPoolConfig, Config
from hcp_jax.evaluation.files import naming
from hcp_jax.evaluation.records import Evaluation, read_evaluation
from hcp_jax.reporting.curves import LABEL, LEFT_OUT, LIMITS, SUCCESS, draw_groups
from hcp_jax.reporting.page import Figure, Item, Row, Section, Table
from hcp_jax.reporting.plots import draw_points
from hcp_jax.reporting.published import Published
from hcp_jax.reporting.settings import RESULTS_COMMANDS
from hcp_jax.reporting.tables import decimals, spread

LIST = "experiments/pool_sizes.py"
NAMES = tuple(f"reacher_pool_{number}" for number in (10, 40, 140, 560, 1440))
COMMANDS = (
    f"python -m hcp_jax.sweep {LIST} --out runs/arms",
    RESULTS_COMMANDS[1],
    "python -m hcp_jax.evaluate results/policies/POLICY --without-robots --json results/arms/pool_sizes/POLICY.json",
)


def pool_size_section(published: Published) -> Section:
    """Success on new arms of the types trained on, and on the type left out, by the number of arms of each type trained on."""
    return Section(
        "pool_sizes",
        "Success against the number of training robots",
        (make_sizes(published), make_size_curves(published)),
        "Exp. I, HCP-E on the reacher, with more and fewer arms of each of the eight types, at equal control steps. The paper "
        "trains on 140. With 1440 there are about as many arms as the training has episodes.",
    )


def make_sizes(published: Published) -> Item:
    """A row for each policy, and a line for each kind of arms."""
    found = sorted(read_sizes(published), key=lambda item: (item[0], item[1].policy))
    if not found:
        return Item("New arms", commands=COMMANDS)
    files = tuple(published.show(evaluation.path) for _, evaluation, _ in found)
    rows, points = [], {"new arms of the types trained on": [], "the type left out": []}
    for number, evaluation, config in found:
        trained = float(np.mean([each.success_mean for each in evaluation.types.values() if not each.zero_shot]))
        left_out = [each for each in evaluation.types.values() if each.zero_shot]
        shown = spread(left_out[0].success_mean, left_out[0].success_std)
        steps = f"{evaluation.env_steps / 1e6:.2f}"
        rows.append(Row((str(number), decimals(trained), shown, str(config.seed), steps, evaluation.policy)))
        for values, success in zip(points.values(), (trained, left_out[0].success_mean), strict=True):
            values.append((number, success))
    columns = ("arms of each type", "types trained on [%]", "type left out [%]", "seed", "control steps [M]", "policy")
    table = Table("Success on new arms", columns, "rrrrrc", tuple(rows), files)
    counts = sorted({evaluation.trials * evaluation.robots_per_trial for _, evaluation, _ in found})
    caption = f"New arms, {' or '.join(map(str, counts))} of each type."
    figure = Figure(draw_points(points, "training arms of each type", LABEL, LIMITS), caption, files)
    return Item("New arms", "", (table,), (figure,), COMMANDS)


def make_size_curves(published: Published) -> Item:
    """Learning curves: new arms of the types trained on, and of the type left out."""
    groups = published.runs_of(NAMES)
    panels = ((SUCCESS, "New arms of the types trained on."), (LEFT_OUT, "The type left out, zero-shot."))
    figures = [draw_groups(published, groups, column, caption, name=lambda config: config.name) for column, caption in panels]
    return Item("Their training", figures=tuple(figure for figure in figures if figure), commands=COMMANDS[:2])


def read_sizes(published: Published) -> Sequence[tuple[int, Evaluation, Config]]:
    """The records in `arms/pool_sizes`, each with its policy's number of training arms of each type and its config.

    Raises RecordError if one's run is not published, or it lacks types trained on or the one left out."""
    folder = published.find("arms/pool_sizes")
    configs, found = {run.folder.name: run.config for run in published.arms}, []
    for path in sorted(folder.glob("*.json")) if folder else ():
        evaluation = read_evaluation(path)
        with naming(path):
            config = configs.get(evaluation.policy)
            if config is None or not isinstance(config.pool, ArmPoolConfig):
                raise ValueError(f"no run of its policy {evaluation.policy} is published")
            if {outcome.zero_shot for outcome in evaluation.types.values()} != {True, False}:
                raise ValueError("expected types that were trained on, and one that was left out")
            found.append((config.pool.robots_per_type, evaluation, config))
    return found

"""Figures of the report, as SVG in data URIs. The same data gives the same bytes."""

import base64
import dataclasses
import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hcp_jax.evaluation.publishing import LINE_STYLES
from hcp_jax.evaluation.summary import SeedCurve

# Colours that colour-blind readers can tell apart (Okabe and Ito), by what a policy sees.
COLOURS = {
    "chain_fk": "#0072B2",
    "kinematics": "#0072B2",
    "none": "#D55E00",
    "chain_fk+jacobian": "#009E73",
    "kinematics+dynamics": "#009E73",
    "chain+dynamics": "#009E73",
    "chain_fk+jacobian+dynamics": "#009E73",
    "embedding": "#CC79A7",
    "none+end_effector": "#E69F00",
    "dynamics": "#E69F00",
    "none+goal_offset": "#56B4E9",
    "random": "#56B4E9",
    "chain": "#000000",
}
_DISTINCT = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # of what does not differ in what it sees
OTHER_COLOUR = "#777777"
_STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "hcp_jax",
}
PANEL = (4.6, 3.6)  # [inch]


@dataclasses.dataclass(frozen=True)
class Line:
    """A learning curve with its name and what its policy sees."""

    label: str
    encoding: str
    curve: SeedCurve


@dataclasses.dataclass(frozen=True)
class Spread:
    """One distribution: all values, or quantiles where no more was kept.

    Attributes:
        label: below it.
        encoding: what the policy sees.
        values: [N], or None.
        quantiles: (lowest, 25 %, median, 75 %, 95 %, highest), used where there are no values.
    """

    label: str
    encoding: str
    values: np.ndarray | None
    quantiles: tuple[float, ...] = ()


def render(draw: Callable[[Axes], None], size: tuple[float, float] = PANEL, projection: str | None = None) -> str:
    """The data URI of a figure of one pair of axes [inch] that `draw` fills."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(size, layout="constrained")
        draw(figure.add_subplot(projection=projection))
        content = io.BytesIO()
        figure.savefig(content, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(content.getvalue()).decode()}"


def draw_curves(lines: Sequence[Line], label: str, limits: tuple[float, float] | None = None) -> str:
    """Mean over seeds, with the range over seeds as a band where there are several. Coloured by what the policies see, or one
    by one where that is the same for all."""
    is_same = len({line.encoding for line in lines}) == 1

    def draw(axes: Axes) -> None:
        drawn: list[str] = []
        for number, line in enumerate(lines):
            colour = _DISTINCT[number % len(_DISTINCT)] if is_same else COLOURS.get(line.encoding, OTHER_COLOUR)
            style = LINE_STYLES[drawn.count(colour) % len(LINE_STYLES)]
            drawn.append(colour)
            curve = line.curve
            axes.plot(curve.steps / 1e6, curve.mean, style, color=colour, label=line.label)
            if curve.num_seeds > 1:
                axes.fill_between(curve.steps / 1e6, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
        axes.set_xlabel("control steps [million]")
        axes.set_ylabel(label)
        if limits:
            axes.set_ylim(*limits)
        axes.figure.legend(loc="outside lower left", fontsize=8)

    return render(draw, (PANEL[0], PANEL[1] + 0.18 * len(lines)))


def draw_points(
    points: Mapping[str, Sequence[tuple[float, float]]], x_label: str, label: str, limits: tuple[float, float]
) -> str:
    """Points (x, y) by name over a logarithmic axis, a line through the means of those of equal x."""

    def draw(axes: Axes) -> None:
        for name, colour in zip(points, _DISTINCT, strict=False):
            x, y = np.asarray(sorted(points[name])).T
            places = np.unique(x)
            axes.plot(places, [np.mean(y[x == place]) for place in places], color=colour, label=name)
            axes.plot(x, y, "o", color=colour, markersize=4)
        axes.set_xscale("log")
        ticks = sorted({x for values in points.values() for x, _ in values})
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_xlabel(x_label)
        axes.set_ylabel(label)
        axes.set_ylim(*limits)
        axes.figure.legend(loc="outside lower left", fontsize=8)

    return render(draw)


def draw_spreads(spreads: Sequence[Spread], label: str, mark: tuple[float, str] | None = None) -> str:
    """Violins with lowest value, median and highest value; boxes of those that are known by quantiles.

    Args:
        spreads: from left to right.
        label: of the vertical axis.
        mark: a height to mark and its name.
    """

    def draw(axes: Axes) -> None:
        for place, spread in enumerate(spreads, start=1):
            colour = COLOURS.get(spread.encoding, OTHER_COLOUR)
            if spread.values is None:
                draw_box(axes, place, spread.quantiles, colour)
            else:
                draw_violin(axes, place, spread.values, colour)
        if mark:
            axes.axhline(mark[0], color="#444444", linewidth=0.8, linestyle="--", label=mark[1])
            axes.figure.legend(loc="outside upper right", fontsize=8)
        axes.set_xticks(range(1, len(spreads) + 1), [spread.label for spread in spreads])
        axes.set_xlim(0.4, len(spreads) + 0.6)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(label)

    return render(draw, (max(PANEL[0], 1.0 + 0.95 * len(spreads)), PANEL[1]))


def draw_violin(axes: Axes, place: int, values: np.ndarray, colour: str) -> None:
    parts = axes.violinplot([values], [place], widths=0.8, showmedians=True)
    for body in parts["bodies"]:  # pyright: ignore[reportGeneralTypeIssues] (of matplotlib's stub)
        body.set(facecolor=colour, alpha=0.5)
    for name in ("cbars", "cmins", "cmaxes", "cmedians"):
        parts[name].set(color=colour, linewidth=1.0)


def draw_box(axes: Axes, place: int, quantiles: Sequence[float], colour: str) -> None:
    """Box from 25 to 75 %, whiskers from the lowest value to 95 %, a ring at the highest."""
    low, first, median, third, high, highest = quantiles
    box = {"whislo": low, "q1": first, "med": median, "q3": third, "whishi": high, "fliers": [highest]}
    line, ring = {"color": colour}, {"markeredgecolor": colour, "marker": "o", "markersize": 4}
    axes.bxp([box], [place], widths=0.5, boxprops=line, medianprops=line, whiskerprops=line, capprops=line, flierprops=ring)

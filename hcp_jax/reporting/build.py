"""Building the report from a folder of results."""

import pathlib

from hcp_jax.config import ConfigError
from hcp_jax.hardware.arm import TYPES
from hcp_jax.reporting.curves import curve_sections
from hcp_jax.reporting.distributions import damping_section, distance_section
from hcp_jax.reporting.hoppers import hopper_section
from hcp_jax.reporting.page import GENERATOR, Figure, Item, Section, write_page
from hcp_jax.reporting.pool_sizes import pool_size_section
from hcp_jax.reporting.published import Published
from hcp_jax.reporting.rehearsals import rehearsal_section
from hcp_jax.reporting.robots import describe_arm, draw_arm, draw_hopper
from hcp_jax.reporting.tables import table_sections

TITLE = "Hardware Conditioned Policies: ours beside the paper"
INTRODUCTION = (
    "What hcp_jax measured, beside the figures of Hardware Conditioned Policies for Multi-Robot Transfer Learning (Chen, "
    "Murali, Gupta, NeurIPS 2018). Differences are ours minus the paper's, in points.\n\n"
    "HCP-E is given a vector v_h of a robot's hardware, HCP-I learns it, DDPG+HER and PPO see none. Of arms, chain is the "
    "paper's v_h, the relative poses of a robot's joints; chain_fk has the poses at the current joint angles, which its "
    "released code feeds in another form, and the end effector's offset from the goal; chain_fk+jacobian adds how the joints "
    "move the end effector. none+goal_offset and none+end_effector see that offset, or the end effector's position, and no "
    "v_h. With aligned joints an entry of observation and action is the same joint in every type, where the paper packs the "
    "joints that an arm has; network film: v_h scales and shifts the hidden layers too. Of several HCP-E of one experiment "
    "the first is the one in README's table.\n\n"
    "Every number and figure is read from the files that are named below it; the commands below an item make these files again."
)


def build_report(results: pathlib.Path) -> tuple[str, list[str]]:
    """The page as HTML, and a line for each file that is missing.

    Args:
        results: a folder that `collect` and `evaluate --json` wrote into.

    Raises:
        ConfigError: there are no results in it.
        RecordError, RunFolderError: one of its files is damaged.
    """
    published = Published(results)
    table1, types = table_sections(published)
    curves, finetuning, *of_type_i = curve_sections(published)
    distances, damping, hopper = distance_section(published), damping_section(published), hopper_section(published)
    rehearsal, sizes = rehearsal_section(published), pool_size_section(published)
    sections = (robot_section(), table1, types, curves, distances, sizes, rehearsal, finetuning, *of_type_i, damping, hopper)
    return write_page(TITLE, INTRODUCTION, sections), published.missing


def robot_section() -> Section:
    """A sketch of each type of arm, and of the hopper."""
    arms = tuple(Figure(draw_arm(name), f"{describe_arm(name)}.") for name in TYPES)
    template = "Drawn with this page, from the kinematics of the nominal robots that hcp_jax compiles from robots/."
    pose = "one of the poses that the reacher starts from, missing joints at 0. Rings: joints, lines: their axes, dot: the tip."
    hopper = Figure(draw_hopper(), "Hopper: thigh, leg and foot joints.")
    items = (Item("Arms, types A to K", f"{template} All in {pose}", figures=arms), Item("Hopper", template, figures=(hopper,)))
    return Section("robots", "The robots", items)


def write_report(results: pathlib.Path, out: pathlib.Path) -> list[str]:
    """Writes the page to `out`, which may only replace a report. Returns lines to say.

    Raises:
        ConfigError: `out` is something else, or there are no results.
        RecordError, RunFolderError: a file of the results is damaged; nothing is written.
    """
    if out.exists() and not is_report(out):
        raise ConfigError(f"--out={out}: exists and is no report of hcp_jax; choose another name")
    page, missing = build_report(results)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(page)
    return [*missing, f"{out}: {len(page) / 1e6:.1f} MB"]


def is_report(path: pathlib.Path) -> bool:
    """Whether a file is a page that `write_report` wrote."""
    return path.is_file() and f'<meta name="generator" content="{GENERATOR}">'.encode() in path.read_bytes()[:1000]

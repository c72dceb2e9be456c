"""What stands in for the paper's test on a real Sawyer: policies that `rehearse` played, condition by condition."""

import numpy as np

from hcp_jax.evaluation.files import naming
from hcp_jax.evaluation.records import Rehearsal, Rehearsed, read_rehearsal
from hcp_jax.reporting.distributions import DISTANCE, SUCCESS_DISTANCE, VIOLINS
from hcp_jax.reporting.page import Figure, Item, Row, Section, Table
from hcp_jax.reporting.plots import Spread, draw_spreads
from hcp_jax.reporting.published import Published
from hcp_jax.reporting.tables import decimals, difference

# The paper's letters (figure "Testing distance distribution on a real sawyer robot"), and the one success rate that it gives.
PAPER_POLICIES = {"reacher_hcpe_leave_h": "A", "reacher_ddpg_leave_h": "B", "reacher_sawyer": "C"}
PAPER_SUCCESS = {"A": 75.0}
REAL = "real"  # all conditions at once
TEXT = (
    "The paper played three policies on a real Sawyer, towards 20 goals each: A, HCP-E of Exp. I; B, DDPG+HER of Exp. II; C, "
    "trained on the Sawyer's model alone with randomised dynamics. Here the Sawyer is the catalogue's, in simulation, driven "
    "as a real arm is: with gravity compensation, sensor noise, a control period that jitters and one step of delay."
)


def rehearsal_section(published: Published) -> Section:
    """Success under each condition, and final distances under all of them."""
    folder = published.find("rehearsal")
    records = sorted((read_rehearsal(path) for path in folder.glob("*.json")) if folder else (), key=_order)
    files = tuple(published.show(record.path) for record in records)
    tables, figures = (), ()
    if records:
        conditions = tuple(dict.fromkeys(name for record in records for name in record.conditions))
        columns = ("policy", "robot", "v_h", *conditions, "paper, real arm", "difference", "median distance, real [m]", "goals")
        rows = tuple(_row(record, conditions) for record in records)
        align = "cll" + "r" * (len(columns) - 3)
        tables = (Table("Success [%] under each condition alone, and under all (real)", columns, align, rows, files),)
        spreads = [_spread(record) for record in records]
        figures = (Figure(draw_spreads(spreads, DISTANCE, SUCCESS_DISTANCE), f"All conditions at once. {VIOLINS}", files),)
    commands = tuple(
        f"python -m hcp_jax.rehearse results/policies/{policy}_s0 --robot sawyer --goals 100 "
        f"--json results/rehearsal/{policy}_s0_sawyer.json"
        for policy in (*PAPER_POLICIES, "reacher_chains")
    )
    return Section("rehearsal", "The Sawyer, driven as a real one", (Item("Reacher", "", tables, figures, commands),), TEXT)


def _row(record: Rehearsal, conditions: tuple[str, ...]) -> Row:
    letter = _letter(record)
    paper, successes = PAPER_SUCCESS.get(letter), {name: each.success for name, each in record.conditions.items()}
    distances = _real(record).final_distances
    return Row(
        (
            f"{letter} {record.policy}".strip(),
            record.robot,
            record.encoding,
            *(decimals(successes.get(name)) for name in conditions),
            decimals(paper),
            difference(successes[REAL], paper),
            f"{np.median(distances):.3f}",
            str(len(distances)),
        )
    )


def _spread(record: Rehearsal) -> Spread:
    inputs = record.encoding.replace("+", "+\n")
    name = _letter(record) or record.policy
    return Spread(f"{name}\n{inputs}", record.encoding, _real(record).final_distances)


def _real(record: Rehearsal) -> Rehearsed:
    with naming(record.path):
        return record.conditions[REAL]


def _letter(record: Rehearsal) -> str:
    return PAPER_POLICIES.get(record.policy.rpartition("_s")[0], "") if record.robot == "sawyer" else ""


def _order(record: Rehearsal) -> tuple[str, str]:
    return _letter(record) or "Z", record.policy

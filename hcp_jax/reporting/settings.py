"""The paper's sixteen experiments, as the report names them."""

import dataclasses

from hcp_jax.evaluation.table1 import PAPER, PREFIXES

TASKS = ("reacher", "peg insertion, fixed hole", "peg insertion, random hole")
ROMAN = ("I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX", "X", "XI", "XII", "XIII", "XIV", "XV", "XVI")
RESULTS_COMMANDS = (
    "python -m hcp_jax.sweep experiments/table1.py --seeds 3 --out runs/arms   # trains",
    "python -m hcp_jax.collect runs/arms --out results                         # publishes metrics and policies",
)
EVALUATE_COMMAND = (
    "python -m hcp_jax.evaluate results/policies/{name} --without-robots --json results/arms/evaluations/{name}.json"
)
TABLES_COMMAND = "python -m hcp_jax.collect --out results                                   # makes the tables anew"
# Experiments without a file of their own, and the list that runs them.
LISTED = tuple(f"{task}_{inputs}_leave_h" for task in ("reacher", "peg") for inputs in ("chain", "end_effector", "goal_offset"))
LISTED_COMMAND = "python -m hcp_jax.sweep experiments/encodings.py --out runs/arms"


@dataclasses.dataclass(frozen=True)
class Setting:
    """What one type is left out of: two experiments of the paper, and our own beside them.

    Attributes:
        experiment: the paper's number of HCP-E; that of DDPG+HER is the next.
        task: one of `TASKS`.
        prefix: of its experiments' names: `reacher`, `peg` or `random_peg`.
        left_out: the type.
        paper: success on that type of HCP-E and of DDPG+HER, mean and deviation [%].
    """

    experiment: int
    task: str
    prefix: str
    left_out: str
    paper: tuple[tuple[float, float], tuple[float, float]]

    @property
    def title(self) -> str:
        return f"Exp. {roman(self.experiment)} and {roman(self.experiment + 1)}: {self.task}, type {self.left_out} left out"

    @property
    def experiment_names(self) -> tuple[str, str]:
        """The files in `experiments/` of HCP-E, with aligned joints and FiLM, on the peg with Jacobians, and of DDPG+HER."""
        return f"{self.prefix}_film_leave_{self.left_out.lower()}", f"{self.prefix}_ddpg_leave_{self.left_out.lower()}"

    def trains(self, name: str) -> bool:
        """Whether an experiment of this name is of this setting."""
        return name.startswith(f"{self.prefix}_") and name.endswith(f"_leave_{self.left_out.lower()}")


def name_inputs(encoding: str, joint_slots: str, network: str) -> str:
    """A policy's v_h, and where its joints stand and its network where those are other than usual."""
    joints = f", {joint_slots} joints" if joint_slots != "packed" else ""
    return encoding + joints + (f", network {network}" if network != "flat" else "")


def roman(experiment: int | None) -> str:
    return "" if experiment is None else ROMAN[experiment - 1]


def _settings() -> tuple[Setting, ...]:
    settings, names = [], dict(zip(PREFIXES.values(), TASKS, strict=True))
    for (task, moves, left_out), (experiment, *paper) in PAPER.items():
        prefix = PREFIXES[task, moves]
        settings.append(Setting(experiment, names[prefix], prefix, left_out, (paper[0], paper[1])))
    return tuple(settings)


SETTINGS = _settings()

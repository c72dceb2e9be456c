"""Robots that somebody names: `H:3`, held-out robot 3 of a type; `train:3`, training robot 3; or an arm of their own."""

import dataclasses
import pathlib
import re
from collections.abc import Sequence
from typing import NamedTuple

from hcp_jax.config import Config, ConfigError, HopperPoolConfig
from hcp_jax.experiment.arm import ArmExperiment, make_heldout_arms
from hcp_jax.experiment.hopper import HopperExperiment, make_heldout_pool
from hcp_jax.hardware import arm, hopper
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.hardware.own_arm import make_own_pool
from hcp_jax.hardware.pool import RobotPool, concatenate_pools
from hcp_jax.hardware.ranges import TYPE_STRIDE

TRAINED = "train"  # the kind of robots that a run was trained on
_CHOICE = re.compile(r"(\w+):(\d+)")


class Choice(NamedTuple):
    """Robot `row` of a kind, from 0: held out, of `hopper` or of a type of arms, numbered as `evaluate` does; or `train`."""

    kind: str
    row: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.row}"


@dataclasses.dataclass(frozen=True)
class ChosenRobot:
    """One robot.

    Attributes:
        name: what it was asked for as.
        pool: it alone.
        joints: names of its driven joints, base first.
        trained_row: its position in the run's training pool, None for one that was not trained on.
    """

    name: str
    pool: RobotPool
    joints: tuple[str, ...]
    trained_row: int | None = None


def read_choice(word: str) -> Choice | None:
    """`H:3` as a choice; None for a word of another form, such as the name of a file."""
    match = _CHOICE.fullmatch(word)
    return Choice(match[1], int(match[2])) if match else None


def heldout_kinds(config: Config) -> tuple[str, ...]:
    """What the task has held-out robots of."""
    if config.task == "hopper":
        return ("hopper",)
    others = arm.OTHER_ARMS if config.task == "reacher" else arm.CHAIN_TYPES
    return tuple(name for name in arm.ALL_TYPES if name not in others)


def check_choice(config: Config, choice: Choice, kinds: Sequence[str], option: str) -> None:
    """Raises ConfigError, which names `option` of the command line, unless the choice is of `kinds` and its row is there."""
    if choice.kind not in kinds:
        raise ConfigError(f"{option}={choice}: expected types out of {', '.join(kinds)} for {config.task}")
    count = config.pool.num_robots if choice.kind == TRAINED else TYPE_STRIDE
    if choice.row >= count:
        raise ConfigError(f"{option}={choice}: expected a row from 0 to {count - 1}")


def make_chosen_pool(run: ArmExperiment | HopperExperiment, choices: Sequence[Choice]) -> RobotPool:
    """One pool of the chosen robots, in that order."""
    counts = {kind: 1 + max(choice.row for choice in choices if choice.kind == kind) for kind, _ in choices}
    pools = {kind: _first_robots(run, kind, count) for kind, count in counts.items()}
    return concatenate_pools(*(pools[kind].subset([row]) for kind, row in choices))


def choose_robot(
    run: ArmExperiment | HopperExperiment, name: str, base: str | None = None, tip: str | None = None
) -> ChosenRobot:
    """Finds or draws one robot, which `--robot` named.

    Args:
        run: the experiment whose policy it gets.
        name: `H:3`, `hopper:3` or `train:3`; or an arm of the catalogue by its name, or its URDF or MJCF file.
        base, tip: links of that arm (`hcp_jax.hardware.robot_file.read_robot`).

    Raises:
        ConfigError: there is no such robot for this run.
        RobotFileError: the file is no arm.
    """
    choice = read_choice(name)
    if choice:
        if base or tip:
            raise ConfigError("--base, --tip: go with a file of an arm")
        check_choice(run.config, choice, (*heldout_kinds(run.config), TRAINED), "--robot")
        pool = make_chosen_pool(run, [choice])
        return ChosenRobot(name, pool, _joint_names(run, pool), choice.row if choice.kind == TRAINED else None)
    if run.config.task == "hopper":
        raise ConfigError(f"--robot={name}: expected hopper:ROW or {TRAINED}:ROW")
    robot = load_robot(name, base, tip)
    return ChosenRobot(pathlib.Path(name).stem, make_own_pool(run.config.task, robot), robot.joints)


def _first_robots(run: ArmExperiment | HopperExperiment, kind: str, count: int) -> RobotPool:
    """At least the first `count` robots of a kind."""
    if kind == TRAINED:
        return run.train_pool
    if isinstance(run.config.pool, HopperPoolConfig):
        return make_heldout_pool(run.config.pool, count)
    return make_heldout_arms(run.config, (kind,), count)


def _joint_names(run: ArmExperiment | HopperExperiment, pool: RobotPool) -> tuple[str, ...]:
    if isinstance(run, HopperExperiment):
        return hopper.JOINTS
    number = int(pool.hardware["type"][0, 0])
    if not 0 <= number < len(arm.TYPES):  # somebody's arm that was trained on, or a random chain
        return tuple(f"joint {slot}" for slot in range(int(pool.hardware["joint_mask"][0].sum())))
    return tuple(joint for joint in arm.JOINTS if joint not in arm.REMOVED_JOINTS[arm.TYPES[number]])

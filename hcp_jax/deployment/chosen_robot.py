"""One robot that a policy is made for, named on the command line: one of a pool, or somebody's arm."""

import dataclasses
import pathlib
import re
from collections.abc import Sequence

from hcp_jax.config import ArmPoolConfig, ConfigError, PoolConfig
from hcp_jax.experiment.arm import ArmExperiment, make_heldout_arms
from hcp_jax.experiment.hopper import HopperExperiment, make_heldout_pool
from hcp_jax.hardware import arm, hopper
from hcp_jax.hardware.arm_pool import TYPE_STRIDE
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.hardware.own_arm import make_own_pool
from hcp_jax.hardware.pool import RobotPool

_POOLED = re.compile(r"(\w+):(\d+)")
TRAINED = "train"


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


def choose_robot(
    run: ArmExperiment | HopperExperiment, name: str, base: str | None = None, tip: str | None = None
) -> ChosenRobot:
    """Finds or draws a robot.

    Args:
        run: the experiment whose policy it gets.
        name: `H:3` or `hopper:3`, held-out robot 3 as `evaluate` numbers them; `train:3`, robot 3 of the training pool; or an
            arm of the catalogue by its name, or its URDF or MJCF file.
        base, tip: links of that arm (`hcp_jax.hardware.robot_file.read_robot`).

    Raises:
        ConfigError: there is no such robot for this run.
        RobotFileError: the file is no arm.
    """
    match = _POOLED.fullmatch(name)
    if not match:
        if run.config.task == "hopper":
            raise ConfigError(f"--robot={name}: expected hopper:NUMBER or {TRAINED}:NUMBER")
        robot = load_robot(name, base, tip)
        return ChosenRobot(pathlib.Path(name).stem, make_own_pool(run.config.task, robot), robot.joints)
    kind, number = match[1], int(match[2])
    is_trained = kind == TRAINED
    count = run.train_pool.num_robots if is_trained else TYPE_STRIDE
    if number >= count:
        raise ConfigError(f"--robot={name}: expected a number of at most {count - 1}")
    pool = run.train_pool if is_trained else _draw(run, name, kind, number + 1)
    pool = pool.subset([number])
    return ChosenRobot(name, pool, _joint_names(run, pool), number if is_trained else None)


def _draw(run: ArmExperiment | HopperExperiment, name: str, kind: str, count: int) -> RobotPool:
    """The first `count` held-out robots of a kind."""
    if isinstance(run.config.pool, PoolConfig):
        _check_kind(name, kind, ("hopper",))
        return make_heldout_pool(run.config.pool, count)
    assert isinstance(run.config.pool, ArmPoolConfig)
    types = [robot for robot in arm.TYPES if run.config.task != "reacher" or robot not in arm.OTHER_ARMS]
    _check_kind(name, kind, types)
    return make_heldout_arms(run.config, (kind,), count)


def _check_kind(name: str, kind: str, kinds: Sequence[str]) -> None:
    if kind not in kinds:
        raise ConfigError(f"--robot={name}: expected NUMBER after one of {', '.join(f'{k}:' for k in (*kinds, TRAINED))}")


def _joint_names(run: ArmExperiment | HopperExperiment, pool: RobotPool) -> tuple[str, ...]:
    if isinstance(run, HopperExperiment):
        return hopper.JOINTS
    number = int(pool.hardware["type"][0, 0])
    if number < 0:  # somebody's arm that was trained on
        return tuple(f"joint {slot}" for slot in range(int(pool.hardware["joint_mask"][0].sum())))
    return tuple(joint for joint in arm.JOINTS if joint not in arm.REMOVED_JOINTS[arm.TYPES[number]])

"""Episodes of chosen robots, state by state, played by the package's own environments and policies."""

import dataclasses
import pathlib
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.config import ArmPoolConfig, Config, ConfigError, PoolConfig
from hcp_jax.experiment.arm import ArmExperiment, make_evaluator, make_heldout_arms
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import HopperExperiment, heldout_v_h, make_heldout_pool, train_v_h
from hcp_jax.experiment.hopper import make_evaluator as make_hopper_evaluator
from hcp_jax.hardware.arm import OTHER_ARMS, TYPES
from hcp_jax.hardware.arm_pool import TYPE_STRIDE
from hcp_jax.hardware.own_arm import make_own_pool
from hcp_jax.hardware.pool import RobotPool, concatenate_pools
from hcp_jax.hardware.robot_file import RobotFile
from hcp_jax.training import run_folder
from hcp_jax.training.warm_start import load_policy

Choice = tuple[str, int]  # a type and a row in it
HOPPER_SETS = ("hopper", "train")  # held-out hoppers, and those trained on
_NUM_HOPPERS = 9  # in a grid


@dataclasses.dataclass(frozen=True)
class Recording:
    """One episode of each of B robots.

    Attributes:
        pool: the robots.
        names: [B] what to call them.
        outcomes: [B] how their episodes ended, in words.
        qpos: [T + 1, B, nq], from the start on; of a robot up to its `length`.
        goal: [B, 3] m of arms, None of hoppers.
        success: [B] bool, whether the goal was reached, or the hopper was up to the end.
        length: [B] control steps of each episode.
        ctrl_dt: [s] between two states.
    """

    pool: RobotPool
    names: tuple[str, ...]
    outcomes: tuple[str, ...]
    qpos: np.ndarray
    goal: np.ndarray | None
    success: np.ndarray
    length: np.ndarray
    ctrl_dt: float


def record_episodes(
    folder: pathlib.Path,
    robots: Sequence[Choice] = (),
    own_robot: tuple[str, RobotFile] | None = None,
    physics: str = "auto",
    seed: int = 0,
    best: bool = False,
) -> Recording:
    """Plays one episode of each robot with the policy of a run folder, as `evaluate` does.

    Args:
        folder: a run folder, or one of a published policy.
        robots: types and rows. Arms: row ROW of the held-out robots of a type. Hoppers: of `hopper`, the held-out ones, which
            get the mean embedding where v_h is learned, or of `train`. By default one robot of every type, or nine hoppers.
        own_robot: one arm with its name, instead of `robots`.
        physics: engine, may be `native-INTEGRATOR`; `auto` takes the run's.
        seed: of start poses, goals and noise.
        best: take the best checkpoint instead of the newest.

    Raises:
        RunFolderError, CheckpointError, ConfigError, RobotFileError: the folder or a robot cannot be played.
        PhysicsOverflowError: the physics dropped contacts or constraints.
    """
    config = run_folder.read_config(folder)
    if not own_robot:
        robots = robots or default_robots(config)
        check_robots(config, robots)
    run = make_experiment(config, None if physics == "auto" else physics)
    state = load_policy(folder, run, best)[1]
    key = jax.random.key(seed)
    if isinstance(run, HopperExperiment):
        return record_hoppers(run, state, robots, key)
    assert isinstance(run, ArmExperiment)
    if own_robot:
        return record_arms(run, state, make_own_pool(config.task, own_robot[1]), [own_robot[0]], key)
    pool = choose_robots(robots, lambda name, count: make_heldout_arms(config, (name,), count))
    return record_arms(run, state, pool, [label(config, *robot) for robot in robots], key)


def default_robots(config: Config) -> list[Choice]:
    """The first held-out robot of every type that the task has; of hoppers the first nine."""
    if config.task == "hopper":
        return [("hopper", row) for row in range(_NUM_HOPPERS)]
    return [(name, 0) for name in TYPES if config.task == "peg_insertion" or name not in OTHER_ARMS]


def check_robots(config: Config, robots: Sequence[Choice]) -> None:
    """Raises ConfigError for a type that the task has not, a row out of range, or a robot that is named twice."""
    allowed = HOPPER_SETS if config.task == "hopper" else dict.fromkeys(name for name, _ in default_robots(config))
    assert isinstance(config.pool, (PoolConfig, ArmPoolConfig))
    for name, row in robots:
        if name not in allowed:
            raise ConfigError(f"--robots={name}:{row}: expected types out of {', '.join(allowed)} for {config.task}")
        count = config.pool.num_robots if name == "train" else TYPE_STRIDE
        if not 0 <= row < count:
            raise ConfigError(f"--robots={name}:{row}: expected a row from 0 to {count - 1}")
        if list(robots).count((name, row)) > 1:
            raise ConfigError(f"--robots={name}:{row}: named twice")


def choose_robots(robots: Sequence[Choice], make_pool) -> RobotPool:
    """One pool of `robots`, in that order; `make_pool(type, count)` makes the first robots of a type."""
    counts = {name: 1 + max(row for other, row in robots if other == name) for name, _ in robots}
    pools = {name: make_pool(name, count) for name, count in counts.items()}
    return concatenate_pools(*(pools[name].subset([row]) for name, row in robots))


def label(config: Config, name: str, row: int) -> str:
    assert isinstance(config.pool, ArmPoolConfig)
    return f"{name}:{row}" if name in config.pool.types else f"{name}:{row} (zero-shot)"


def record_arms(run: ArmExperiment, state, pool: RobotPool, names: Sequence[str], key: jax.Array) -> Recording:
    """One episode of each arm of `pool`; it ends at success."""
    evaluator = make_evaluator(run.config, run.learner, run.make_env, pool, run.train_pool)
    episodes, states = evaluator.record(run.learner.policy(state), np.arange(pool.num_robots), key)
    task = evaluator.env.task
    ctrl_dt = task.sim_dt * task.num_substeps
    columns = (episodes.success, episodes.diverged, episodes.episode_length * ctrl_dt, episodes.final_distance)
    return Recording(
        pool=pool,
        names=tuple(names),
        outcomes=tuple(arm_outcome(*row) for row in zip(*columns, strict=True)),
        qpos=states.qpos,
        goal=episodes.desired_goal,
        success=episodes.success,
        length=episodes.episode_length,
        ctrl_dt=ctrl_dt,
    )


def arm_outcome(success: bool, diverged: bool, seconds: float, distance: float) -> str:
    if diverged:
        return "the physics diverged"
    return f"reached after {seconds:.1f} s" if success else f"{100 * distance:.0f} cm away"


def record_hoppers(run: HopperExperiment, state, robots: Sequence[Choice], key: jax.Array) -> Recording:
    """One episode of each hopper; it ends at the task's limits of height, pitch and time."""
    config = run.config.pool
    assert isinstance(config, PoolConfig)
    pool = choose_robots(robots, lambda name, count: make_heldout_pool(config, count) if name == "hopper" else run.train_pool)
    new, known = heldout_v_h(run, state.params, pool), train_v_h(run, state.params)
    v_h = jnp.stack([new[i] if name == "hopper" else known[row] for i, (name, row) in enumerate(robots)])
    evaluator = make_hopper_evaluator(run.ppo, run.make_env(pool))
    params = (state.params["network"], state.obs_statistics)
    episodes, states = evaluator.record(params, run.ppo.visible(state, v_h), np.arange(len(robots)), key)
    task = evaluator.env.task
    ctrl_dt = task.sim_dt * task.num_substeps
    is_short = episodes.episode_length < task.episode_length
    outcomes = [
        f"return {value:.0f}, {'ended after' if is_down else 'up for'} {length * ctrl_dt:.1f} s"
        for value, is_down, length in zip(episodes.episode_return, is_short, episodes.episode_length, strict=True)
    ]
    return Recording(
        pool=pool,
        names=tuple(f"{name}:{row}" for name, row in robots),
        outcomes=tuple(outcomes),
        qpos=states.qpos,
        goal=None,
        success=~is_short,
        length=episodes.episode_length,
        ctrl_dt=ctrl_dt,
    )

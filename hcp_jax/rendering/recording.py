"""Episodes of chosen robots, state by state, played by the package's own environments and policies."""

import dataclasses
import pathlib
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.config import ArmPoolConfig, Config, ConfigError
from hcp_jax.experiment.arm import ArmExperiment, make_evaluator
from hcp_jax.experiment.build import for_own_robots, make_experiment
from hcp_jax.experiment.chosen_robots import TRAINED, Choice, check_choice, heldout_kinds, make_chosen_pool
from hcp_jax.experiment.hopper import HopperExperiment, heldout_v_h, train_v_h
from hcp_jax.experiment.hopper import make_evaluator as make_hopper_evaluator
from hcp_jax.hardware.arm import CHAIN_TYPES
from hcp_jax.hardware.own_arm import make_own_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.robot_file import RobotFile
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy

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
        robots: held-out ones, which get the mean embedding where v_h is learned; hoppers also of `train`. By default one robot
            of every type, or nine hoppers.
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
    run = make_experiment(for_own_robots(config) if own_robot else config, physics)
    state = load_policy(folder, run, best)[1]
    key = jax.random.key(seed)
    if isinstance(run, HopperExperiment):
        return record_hoppers(run, state, robots, key)
    assert isinstance(run, ArmExperiment)
    if own_robot:
        return record_arms(run, state, make_own_pool(config.task, own_robot[1]), [own_robot[0]], key)
    return record_arms(run, state, make_chosen_pool(run, robots), [label(config, robot) for robot in robots], key)


def default_robots(config: Config) -> list[Choice]:
    """The first held-out robot of every type that the task has, of random chains where they are trained on; of hoppers nine."""
    rows = range(_NUM_HOPPERS if config.task == "hopper" else 1)
    trained = config.pool.types if isinstance(config.pool, ArmPoolConfig) else ()
    kinds = [kind for kind in heldout_kinds(config) if kind not in CHAIN_TYPES or kind in trained]
    return [Choice(kind, row) for kind in kinds for row in rows]


def check_robots(config: Config, robots: Sequence[Choice]) -> None:
    """Raises ConfigError for a type that the task has not, a row out of range, or a robot that is named twice."""
    kinds = (*heldout_kinds(config), *((TRAINED,) if config.task == "hopper" else ()))
    for robot in robots:
        check_choice(config, robot, kinds, "--robots")
        if list(robots).count(robot) > 1:
            raise ConfigError(f"--robots={robot}: named twice")


def label(config: Config, robot: Choice) -> str:
    assert isinstance(config.pool, ArmPoolConfig)
    return str(robot) if robot.kind in config.pool.types else f"{robot} (zero-shot)"


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
        qpos=np.asarray(states.qpos),
        goal=np.asarray(episodes.desired_goal),
        success=np.asarray(episodes.success),
        length=np.asarray(episodes.episode_length),
        ctrl_dt=ctrl_dt,
    )


def arm_outcome(success: bool, diverged: bool, seconds: float, distance: float) -> str:
    if diverged:
        return "the physics diverged"
    return f"reached after {seconds:.1f} s" if success else f"{100 * distance:.0f} cm away"


def record_hoppers(run: HopperExperiment, state, robots: Sequence[Choice], key: jax.Array) -> Recording:
    """One episode of each hopper; it ends at the task's limits of height, pitch and time."""
    pool = make_chosen_pool(run, robots)
    new, known = heldout_v_h(run, state.params, pool), train_v_h(run, state.params)
    v_h = jnp.stack([known[robot.row] if robot.kind == TRAINED else new[i] for i, robot in enumerate(robots)])
    evaluator = make_hopper_evaluator(run.learner, run.make_env(pool))
    params = (state.params["network"], state.obs_statistics)
    episodes, states = evaluator.record(params, run.learner.visible(state, v_h), np.arange(len(robots)), key)
    task = evaluator.env.task
    ctrl_dt = task.sim_dt * task.num_substeps
    is_short = episodes.episode_length < task.episode_length
    outcomes = [
        f"return {value:.0f}, {'ended after' if is_down else 'up for'} {length * ctrl_dt:.1f} s"
        for value, is_down, length in zip(episodes.episode_return, is_short, episodes.episode_length, strict=True)
    ]
    return Recording(
        pool=pool,
        names=tuple(map(str, robots)),
        outcomes=tuple(outcomes),
        qpos=np.asarray(states.qpos),
        goal=None,
        success=~np.asarray(is_short),
        length=np.asarray(episodes.episode_length),
        ctrl_dt=ctrl_dt,
    )

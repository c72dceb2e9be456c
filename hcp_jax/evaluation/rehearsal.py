"""A reacher policy on one arm under conditions like those of a real one, which stands in for the paper's test on a Sawyer (its
section 5.1, "Zero-shot transfer to a real Sawyer robot"): 20 goals, how far from each the end effector ends."""

import dataclasses
import pathlib
from collections import deque
from collections.abc import Callable

import jax
import mujoco
import numpy as np

from hcp_jax.config import ArmConfig, ConfigError
from hcp_jax.deployment.robot_model import arm_model
from hcp_jax.deployment.robot_policy import make_robot_policy
from hcp_jax.envs.arm import CTRL_DT, REACHER_GOALS
from hcp_jax.evaluation.records import QUANTILES
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.chosen_robots import ChosenRobot, choose_robot
from hcp_jax.hardware.chain import TIP_SITE
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy

SIM_DT = 0.001  # [s], with RK4: nothing was trained on it
DIVERGED = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


@dataclasses.dataclass(frozen=True)
class Conditions:
    """How an arm is driven.

    Attributes:
        gravity_compensation: the arm's own controller carries its weight, which policies were not trained with.
        angle_noise, velocity_noise: standard deviation of the sensors' noise [rad], [rad/s].
        jitter: a control period lasts 20 ms plus or minus at most this [s], uniform.
        delay: control periods between an observation and its torques.
    """

    gravity_compensation: bool = False
    angle_noise: float = 0.0
    velocity_noise: float = 0.0
    jitter: float = 0.0
    delay: int = 0


IDEAL = Conditions()
REAL = Conditions(gravity_compensation=True, angle_noise=0.005, velocity_noise=0.05, jitter=0.005, delay=1)
# What is reported: each part of `REAL` alone tells what a policy cannot stand.
CONDITIONS = {
    "ideal": IDEAL,
    "gravity compensation": Conditions(gravity_compensation=True),
    "noise": Conditions(angle_noise=REAL.angle_noise, velocity_noise=REAL.velocity_noise),
    "jitter": Conditions(jitter=REAL.jitter),
    "delay": Conditions(delay=REAL.delay),
    "real": REAL,
}


@dataclasses.dataclass(frozen=True)
class Trial:
    """One goal: whether it was reached, distances [m] at the end (which is when it is reached) and at the closest, steps.

    An arm whose physics diverges fails where it was before.
    """

    goal: tuple[float, ...]
    success: bool
    final_distance: float
    closest_distance: float
    episode_length: int


def rehearse(
    folder: pathlib.Path, robot_name: str, num_goals: int, base: str | None = None, tip: str | None = None, seed: int = 0
) -> dict:
    """Plays a policy on one arm, towards the same goals under each of `CONDITIONS`.

    Args:
        folder: a run folder, or a published policy, of the reacher.
        robot_name, base, tip: the arm (`hcp_jax.experiment.chosen_robots.choose_robot`).
        num_goals: drawn uniformly from the task's box, reachable or not, each with a start pose.
        seed: of goals, start poses, noise and jitter.

    Returns:
        the record that `rehearse --json` writes; success in percent, distances in m.

    Raises:
        ConfigError, RunFolderError, CheckpointError, RobotFileError: the run or the arm cannot be played.
    """
    config = run_folder.read_config(folder)
    if config.task != "reacher":
        raise ConfigError(f"{folder}: a policy of {config.task}: expected one of the reacher")
    assert isinstance(config.env, ArmConfig)
    run = make_experiment(config, "native")
    iteration, state = load_policy(folder, run)
    robot = choose_robot(run, robot_name, base, tip)
    act = jax.jit(make_robot_policy(run, state, robot).function)
    rng = np.random.default_rng(seed)
    goals = rng.uniform(*REACHER_GOALS, (num_goals, 3))
    poses = robot.pool.hardware["start_angles"][0, :, : len(robot.joints)]
    starts = poses[rng.integers(0, len(poses), num_goals)]
    record = {
        "run": str(folder),
        "robot": robot.name,
        "encoding": config.encoding,
        "checkpoint_env_steps": iteration * config.steps_per_iteration,
        "commit": run_folder.read_commit(),
        "seed": seed,
        "conditions": {},
    }
    for name, conditions in CONDITIONS.items():
        model = make_model(robot, conditions)
        trials = [
            play(model, act, start, goal, conditions, config.env, np.random.default_rng([seed, number]))
            for number, (start, goal) in enumerate(zip(starts, goals, strict=True))
        ]
        record["conditions"][name] = dataclasses.asdict(conditions) | summarise(trials)
    return record


def make_model(robot: ChosenRobot, conditions: Conditions) -> mujoco.MjModel:
    """The arm in C MuJoCo; its controls are shares of its torque limits."""
    spec = arm_model(robot)
    spec.option.timestep, spec.option.integrator = SIM_DT, mujoco.mjtIntegrator.mjINT_RK4
    for body in spec.bodies[1:]:
        body.gravcomp = float(conditions.gravity_compensation)
    return spec.compile()


def play(
    model: mujoco.MjModel,
    act: Callable[[np.ndarray], jax.Array],
    start: np.ndarray,
    goal: np.ndarray,
    conditions: Conditions,
    task: ArmConfig,
    rng: np.random.Generator,
) -> Trial:
    """One episode, which ends at success.

    Args:
        model: of `make_model`, with n joints.
        act: torques [n] N m for angles, velocities and goal [2 n + 3].
        start: angles [n] rad.
        goal: [3] m.
        conditions: how the arm is driven.
        task: its success distance and number of steps.
        rng: of noise and jitter.
    """
    data, limit = mujoco.MjData(model), model.actuator_gear[:, 0]

    def measure_distance() -> float:
        mujoco.mj_kinematics(model, data)
        return float(np.linalg.norm(data.site(TIP_SITE).xpos - goal))

    data.qpos[:] = start
    waiting = deque([np.zeros(model.nu)] * conditions.delay)
    noise = np.repeat([conditions.angle_noise, conditions.velocity_noise], model.nv)
    distance = closest = measure_distance()
    success, steps = False, 0
    while not success and steps < task.episode_length:
        sensed = np.concatenate([data.qpos, data.qvel]) + noise * rng.normal(size=2 * model.nv)
        waiting.append(np.asarray(act(np.concatenate([sensed, goal]).astype(np.float32))) / limit)
        data.ctrl[:] = waiting.popleft()
        period = CTRL_DT + conditions.jitter * rng.uniform(-1.0, 1.0)
        mujoco.mj_step(model, data, nstep=max(1, round(period / SIM_DT)))
        if any(data.warning[kind].number for kind in DIVERGED):  # MuJoCo has reset the arm to its first state
            break
        distance, steps = measure_distance(), steps + 1
        closest, success = min(closest, distance), distance < task.success_distance
    return Trial(tuple(goal.tolist()), success, distance, closest, steps)


def summarise(trials: list[Trial]) -> dict:
    """Success and distances over all trials, and the trials."""

    def quantiles(name: str) -> dict[str, float]:
        values = [getattr(trial, name) for trial in trials]
        return {f"{q:g}": float(np.quantile(values, q)) for q in QUANTILES}

    return {
        "success": 100.0 * float(np.mean([trial.success for trial in trials])),
        "final_distance_quantiles": quantiles("final_distance"),
        "closest_distance_quantiles": quantiles("closest_distance"),
        "trials": [dataclasses.asdict(trial) for trial in trials],
    }

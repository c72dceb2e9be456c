"""The folder that `export` writes: a policy for one robot as ONNX and as `jax.export`, the robot's model, and what they say."""

import importlib.util
import json
import pathlib

import jax
import jax.export
import numpy as np

from hcp_jax.config import ArmConfig, Config, ConfigError
from hcp_jax.deployment.robot_model import write_model
from hcp_jax.deployment.robot_policy import RobotPolicy, make_robot_policy
from hcp_jax.envs.arm import HOLE, REACHER_GOALS
from hcp_jax.envs.hopper import INITIAL_HEIGHT
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.chosen_robots import ChosenRobot, choose_robot
from hcp_jax.hardware.chain import TIP_SITE
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy

ONNX_FILE, JAX_FILE, MODEL_FILE, DESCRIPTION_FILE = "policy.onnx", "policy.jax_export", "robot.xml", "policy.json"
INPUT, OUTPUT = "observation", "torque"
PLATFORMS = ("cpu", "cuda", "tpu")
_FORMAT = 1


def export_policy(
    folder: pathlib.Path,
    robot_name: str,
    out: pathlib.Path,
    base: str | None = None,
    tip: str | None = None,
    best: bool = False,
) -> dict:
    """Writes the policy of a run folder for one robot into the new folder `out`.

    Args:
        folder: a run folder or a published policy.
        robot_name, base, tip: the robot (`choose_robot`).
        out: where to write; it must not exist.
        best: take the best checkpoint instead of the newest.

    Returns:
        what `policy.json` says.

    Raises:
        ConfigError: `out` exists, there is no such robot, or the package `onnx` is missing.
        RunFolderError, CheckpointError, RobotFileError: the folder or the robot's file cannot be read.
    """
    if out.exists():
        raise ConfigError(f"--out={out}: already exists; choose another folder")
    if importlib.util.find_spec("onnx") is None:
        raise ConfigError("export writes ONNX and the package onnx is missing: pip install onnx (or the extra `export`)")
    from hcp_jax.deployment.onnx_graph import to_onnx

    run = make_experiment(run_folder.read_config(folder), "native")
    robot = choose_robot(run, robot_name, base, tip)
    iteration, state = load_policy(folder, run, best)
    policy = make_robot_policy(run, state, robot)
    task, observation = run.make_env(robot.pool).task, example_observation(run.config.task, robot, len(policy.observation))
    with jax.default_matmul_precision("highest"):
        jitted = jax.jit(policy.function)
        exported = jax.export.export(jitted, platforms=PLATFORMS)(jax.ShapeDtypeStruct(observation.shape, np.float32))
        graph = to_onnx(policy.function, len(observation), INPUT, OUTPUT)
        torque = np.asarray(jitted(observation))
    description = {
        "format": _FORMAT,
        **describe_source(run.config, folder, iteration),
        "robot": robot.name,
        "units": "SI: s, m, rad, N m",
        "control_period": task.sim_dt * task.num_substeps,
        "episode_length": task.episode_length,
        "input": describe_input(policy),
        "output": describe_output(policy, robot),
        **describe_arm_task(run.config, robot),
        "example": {INPUT: observation.tolist(), OUTPUT: torque.tolist()},
    }
    files = {
        ONNX_FILE: graph.SerializeToString(),
        JAX_FILE: exported.serialize(),
        MODEL_FILE: write_model(robot, task.sim_dt, run.config.env.integrator).encode(),
        DESCRIPTION_FILE: (json.dumps(description, indent=1) + "\n").encode(),
    }
    out.mkdir(parents=True)
    for name, content in files.items():
        (out / name).write_bytes(content)
    return description


def describe_source(config: Config, folder: pathlib.Path, iteration: int) -> dict:
    """Where the policy is from, and what wrote the files."""
    return {
        "run": str(folder),
        "task": config.task,
        "algorithm": config.algorithm,
        "encoding": config.encoding,
        "checkpoint_env_steps": iteration * config.steps_per_iteration,
        "commit": run_folder.read_commit(),
        "jax": jax.__version__,
    }


def describe_input(policy: RobotPolicy) -> dict:
    entries = [{"name": name, "unit": unit} for name, unit in policy.observation]
    return {"name": INPUT, "dtype": "float32", "shape": [len(entries)], "entries": entries}


def describe_output(policy: RobotPolicy, robot: ChosenRobot) -> dict:
    entries = [
        {"name": f"torque of {joint}", "unit": "N m", "limit": float(limit)}
        for joint, limit in zip(robot.joints, policy.torque_limit, strict=True)
    ]
    return {"name": OUTPUT, "dtype": "float32", "shape": [len(entries)], "entries": entries}


def describe_arm_task(config: Config, robot: ChosenRobot) -> dict:
    """Where an arm's goals and start poses of training were, what counted as success, and the noise; nothing for a hopper."""
    if not isinstance(config.env, ArmConfig):
        return {}
    low, high = REACHER_GOALS
    if config.task != "reacher":
        low, high = (tuple(np.add(HOLE, side * config.env.random_hole).tolist()) for side in (-0.5, 0.5))
    starts = robot.pool.hardware["start_angles"][0, :, : len(robot.joints)]
    return {
        "goal": {"site": TIP_SITE, "low": low, "high": high, "success_distance": config.env.success_distance},
        "observation_noise": config.env.observation_noise,
        "start_angles": np.round(starts, 6).tolist(),
    }


def example_observation(task: str, robot: ChosenRobot, size: int) -> np.ndarray:
    """An observation to check a consumer with: at rest in the first start pose, the goal in the middle; a hopper's stand."""
    observation = np.zeros(size, np.float32)
    if task == "hopper":
        observation[0] = INITIAL_HEIGHT
        return observation
    count = len(robot.joints)
    observation[:count] = robot.pool.hardware["start_angles"][0, 0, :count]
    observation[2 * count :] = np.mean(REACHER_GOALS, axis=0) if task == "reacher" else HOLE
    return observation

"""A policy for one robot as one function: what its sensors say and the goal in, torques out."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.config import ArmConfig
from hcp_jax.envs.goal import MAX_SPEED
from hcp_jax.envs.hopper import MAX_OBSERVED_VELOCITY
from hcp_jax.experiment.arm import ArmExperiment, make_goal_conditioning
from hcp_jax.experiment.chosen_robots import ChosenRobot
from hcp_jax.experiment.hopper import HopperExperiment, heldout_v_h, train_v_h
from hcp_jax.hardware.chain import MAX_JOINTS
from hcp_jax.hardware.joint_slots import JointSlots

Entries = tuple[tuple[str, str], ...]  # (name, unit) of each entry of a vector


@dataclasses.dataclass(frozen=True)
class RobotPolicy:
    """A policy with everything about its robot inside.

    Attributes:
        function: torques [J] N m, within their limits, for an observation [O], both float32.
        observation: of each of the O entries; noise-free, not scaled, without padding.
        torque_limit: [J] N m.
    """

    function: Callable[[jax.Array], jax.Array]
    observation: Entries
    torque_limit: np.ndarray


def make_robot_policy(run: ArmExperiment | HopperExperiment, state: Any, robot: ChosenRobot) -> RobotPolicy:
    """The policy of a run's `state` for one robot; the arm's goal follows its joint velocities in the observation."""
    limit = robot.pool.fields["actuator_gear"][0, : len(robot.joints), 0]
    if isinstance(run, HopperExperiment):
        act, observation = _hopper_policy(run, state, robot), _hopper_entries(robot)
    else:
        act, observation = _arm_policy(run, state, robot), _arm_entries(robot)
    scale = jnp.asarray(limit, jnp.float32)
    return RobotPolicy(lambda obs: jnp.clip(act(obs), -1.0, 1.0) * scale, observation, limit)


def _arm_policy(run: ArmExperiment, state: Any, robot: ChosenRobot) -> Callable[[jax.Array], jax.Array]:
    """Actions [J] in units of the torque limits. A v_h that is learned, and not of this robot, is the training robots' mean."""
    conditioning = make_goal_conditioning(run.config, robot.pool, run.train_pool)
    networks, statistics = run.learner.policy(state)
    if conditioning.is_learned:
        rows, row = networks["embedding"], robot.trained_row
        networks = networks | {"embedding": (rows.mean(axis=0) if row is None else rows[row])[None]}
    count = len(robot.joints)
    assert isinstance(run.config.env, ArmConfig)
    slots = JointSlots(robot.pool, run.config.env.joint_slots)

    def act(obs: jax.Array) -> jax.Array:
        angles, velocities, goal = jnp.split(obs, [count, 2 * count])
        index = jnp.zeros(1, jnp.int32)
        velocities = jnp.clip(velocities, -MAX_SPEED, MAX_SPEED)  # as in training
        padded = [jnp.pad(part[None], ((0, 0), (0, MAX_JOINTS - count))) for part in (angles, velocities)]
        obs = jnp.concatenate([slots.to_entries(part, index) for part in padded], axis=-1)
        action = run.learner.mean_action(networks, statistics, conditioning, index, obs, goal[None])
        return slots.to_joints(action, index)[0, :count]

    return act


def _arm_entries(robot: ChosenRobot) -> Entries:
    angles = tuple((f"angle of {joint}", "rad") for joint in robot.joints)
    velocities = tuple((f"velocity of {joint}", "rad/s") for joint in robot.joints)
    return (*angles, *velocities, *((f"goal {axis}", "m") for axis in "xyz"))


def _hopper_policy(run: HopperExperiment, state: Any, robot: ChosenRobot) -> Callable[[jax.Array], jax.Array]:
    row = robot.trained_row
    v_h = heldout_v_h(run, state.params, robot.pool)[:1] if row is None else train_v_h(run, state.params)[row : row + 1]
    v_h = run.learner.visible(state, v_h)
    num_positions = 2 + len(robot.joints)

    def act(obs: jax.Array) -> jax.Array:
        position, velocity = jnp.split(obs, [num_positions])
        velocity = jnp.clip(velocity, -MAX_OBSERVED_VELOCITY, MAX_OBSERVED_VELOCITY)
        observed = jnp.concatenate([position, velocity])[None]
        return run.learner.mean_action(state.params["network"], state.obs_statistics, observed, v_h)[0]

    return act


def _hopper_entries(robot: ChosenRobot) -> Entries:
    positions = (("position of rootz", "m"), *((f"angle of {joint}", "rad") for joint in ("rooty", *robot.joints)))
    velocities = (("velocity of rootx", "m/s"), ("velocity of rootz", "m/s"))
    return (*positions, *velocities, *((f"velocity of {joint}", "rad/s") for joint in ("rooty", *robot.joints)))

"""The MuJoCo model of one robot as the policy knows it, without padding and with torques as controls."""

import mujoco

from hcp_jax.experiment.chosen_robots import ChosenRobot
from hcp_jax.hardware import chain, hopper
from hcp_jax.hardware.arm_pool import read_pooled_chain
from hcp_jax.physics.base import MJ_INTEGRATORS

_NO_JOINT = "hcp_jax "  # begins names that no file has


def write_model(robot: ChosenRobot, sim_dt: float, integrator: str) -> str:
    """MJCF with the robot's joint names, whose controls are torques [N m]. MuJoCo writes numbers with six digits.

    Args:
        robot: an arm or a hopper.
        sim_dt: physics time step [s].
        integrator: one of `hcp_jax.physics.base.INTEGRATORS`.
    """
    is_arm = "chain_pos" in robot.pool.hardware
    spec = arm_model(robot) if is_arm else hopper_model(robot)
    spec.option.timestep, spec.option.integrator = sim_dt, MJ_INTEGRATORS[integrator]
    for motor in spec.actuators:
        limit = motor.gear[0]
        motor.gear, motor.ctrlrange = [1, 0, 0, 0, 0, 0], [-limit, limit]
    spec.compile()
    return spec.to_xml()


def arm_model(robot: ChosenRobot) -> mujoco.MjSpec:
    """A chain of the arm's joints, its `ref_pt` and what its task puts beside it."""
    spec = mujoco.MjSpec.from_string(chain.without_padding(robot.pool.template, len(robot.joints)))
    chain.edit_spec(spec, read_pooled_chain(robot.pool, 0))
    driven = [(spec.joint(f"slot{slot}"), spec.actuator(f"slot{slot}")) for slot in range(len(robot.joints))]
    for slot, (joint, motor) in enumerate(driven):  # free the names first: a robot's joint may be called as another's slot
        joint.name = motor.name = motor.target = f"{_NO_JOINT}{slot}"
    for name, (joint, motor) in zip(robot.joints, driven, strict=True):
        joint.name = motor.name = motor.target = name
    return spec


def hopper_model(robot: ChosenRobot) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_string(robot.pool.template)
    hopper.edit_spec(spec, {name: values[0] for name, values in robot.pool.hardware.items()})
    return spec

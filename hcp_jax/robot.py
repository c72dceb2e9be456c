"""`python -m hcp_jax.robot check FILE [--base LINK] [--tip LINK] [--policy RUN] [--json FILE]`: what we make of your arm."""

import argparse
import dataclasses
import pathlib

import numpy as np
from rich.table import Table

from hcp_jax import command_line, presets
from hcp_jax.config import ArmPoolConfig, ConfigError
from hcp_jax.evaluation.files import write_json
from hcp_jax.experiment.arm import make_train_arms
from hcp_jax.hardware.arm_encodings import encode_arms
from hcp_jax.hardware.arm_pool import CHAIN_TEMPLATES
from hcp_jax.hardware.catalogue import catalogue_names, load_robot
from hcp_jax.hardware.own_arm import SCALARS, compare_with, find_nearest, make_own_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.robot_file import RobotFile
from hcp_jax.training.run_folder import read_config


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.robot",
        description="Reads an arm from a URDF or MJCF file.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("action", choices=["check"])
    parser.add_argument("file", help=f"URDF or MJCF, meshes may be missing; or one of {', '.join(catalogue_names())}")
    command_line.add_chain_options(parser)
    parser.add_argument("--policy", type=pathlib.Path, help="run or published policy whose training arms to compare with")
    parser.add_argument("--task", choices=list(CHAIN_TEMPLATES), default="reacher", help="else the paper's arms, of this task")
    parser.add_argument("--json", type=command_line.output_file(".json"), help="file to write all of it to")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        robot = load_robot(options.file, options.base, options.tip)
        config = read_config(options.policy) if options.policy else presets.arm("trained", options.task, "none")
        if not isinstance(config.pool, ArmPoolConfig) or config.robot:
            raise ConfigError(f"--policy={options.policy}: expected one that was trained on types of arms")
        for note in robot.notes:  # first: an arm that can be read may still reach nothing
            command_line.show(f"note: {note}")
        own, trained = make_own_pool(config.task, robot), make_train_arms(config)
        record = describe(robot, own, trained)
        print_record(record)
        if options.json:
            write_json(options.json, record)


def describe(robot: RobotFile, own: RobotPool, trained: RobotPool) -> dict:
    """Joints, assumptions, v_h, and where the arm lies outside the training arms."""
    hardware, count = own.hardware, robot.chain.num_joints
    joints = [
        {
            "name": name,
            "range": np.round(hardware["joint_range"][0, slot], 4).tolist(),
            **{column: round(float(hardware[column][0, slot]), 5) for column in SCALARS},
        }
        for slot, name in enumerate(robot.joints)
    ]
    robot_type, robot_id, distance = find_nearest(own, trained)
    entries = compare_with(own, trained)
    return {
        "base": robot.base,
        "tip": robot.tip,
        "joints": joints,
        "notes": list(robot.notes),
        "num_start_poses": int(hardware["start_angles"].shape[1]),
        "chain": np.round(encode_arms(own, "chain", trained)[0], 5).reshape(-1, 6)[: count + 1].tolist(),
        "nearest": {"type": robot_type, "robot_id": robot_id, "distance": round(distance, 3)},
        "entries": [dataclasses.asdict(entry) | {"is_inside": entry.is_inside} for entry in entries],
    }


def print_record(record: dict) -> None:
    table = Table(title=f"{record['base']} to {record['tip']}: {len(record['joints'])} joints")
    heads = ("joint", "range [rad]", "torque limit [N m]", "mass [kg]", "damping", "friction loss", "armature")
    for head in heads:
        table.add_column(head, justify="left" if head == "joint" else "right")
    for joint in record["joints"]:
        numbers = (f"{joint[name]:g}" for name in SCALARS)
        table.add_row(joint["name"], "{:.2f} to {:.2f}".format(*joint["range"]), *numbers)
    command_line.show(table)
    poses = Table(title="v_h (`chain`): each joint in the frame of the one before, last the tip")
    for head in ("", "x [m]", "y [m]", "z [m]", "x [rad]", "y [rad]", "z [rad]"):
        poses.add_column(head, justify="right")
    for name, row in zip([*(joint["name"] for joint in record["joints"]), record["tip"]], record["chain"], strict=True):
        poses.add_row(name, *(f"{value:.4f}" for value in row))
    command_line.show(poses)
    nearest = record["nearest"]
    command_line.show(
        f"nearest training arm: type {nearest['type']}, robot {nearest['robot_id']}, "
        f"{nearest['distance']:.2f} standard deviations away"
    )
    outside = [entry for entry in record["entries"] if not entry["is_inside"]]
    command_line.show(f"outside the training arms' ranges: {len(outside)} of {len(record['entries'])} entries")
    for entry in outside:
        trained = "none that has it" if entry["low"] is None else f"{entry['low']:.4g} to {entry['high']:.4g}"
        command_line.show(f"  {entry['name']}: {entry['value']:.4g}, trained on {trained}")


if __name__ == "__main__":
    main()

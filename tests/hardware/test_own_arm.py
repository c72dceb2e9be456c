import dataclasses
import itertools
import json
import shutil

import jax.numpy as jnp
import numpy as np
import pytest
from robot_texts import arm

from hcp_jax import evaluate, robot
from hcp_jax.hardware.arm import arm_spec, sample_hardware
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.hardware.chain import read_chain
from hcp_jax.hardware.kinematics import joint_poses, quat_to_matrix
from hcp_jax.hardware.own_arm import compare_with, find_nearest, make_own_pool
from hcp_jax.hardware.pool import RobotPool, robots_path
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.hardware.robot_file import RobotFile, RobotFileError, read_robot_here
from hcp_jax.hardware.start_poses import GRID

TEMPLATE = robots_path() / "arm_reacher.xml"


@pytest.fixture(scope="module")
def trained() -> RobotPool:
    return make_arm_pool("reacher", ArmRanges(), ("A", "I"), 3, seed=0)


@pytest.fixture(scope="module")
def one_of_them() -> RobotFile:
    """Training arm 1 of type A, as if it came from a file."""
    hardware = {name: values[1] for name, values in sample_hardware(ArmRanges(), "A", 3, seed=0).items()}
    chain = read_chain(arm_spec("reacher", "A", hardware).compile())
    return RobotFile(chain, tuple("abcde"), "base", "tip", ())


def test_a_training_arm_is_inside_all_ranges_and_its_own_nearest(one_of_them, trained):
    own = make_own_pool("reacher", one_of_them)
    robot_type, robot_id, distance = find_nearest(own, trained)
    assert (robot_type, robot_id) == ("A", trained.robot_id[1])
    assert distance == pytest.approx(0.0, abs=1e-6)
    assert all(entry.is_inside for entry in compare_with(own, trained))
    np.testing.assert_allclose(own.fields["body_mass"][0], trained.fields["body_mass"][1])


def test_its_start_poses_are_at_the_points_that_the_reacher_starts_from(one_of_them):
    own = make_own_pool("reacher", one_of_them)
    poses = own.hardware["start_angles"][0]
    assert len(poses) > 20
    assert (poses[:, 5:] == 0).all()
    rotations = quat_to_matrix(jnp.asarray(own.hardware["chain_quat"][0]))
    reached = jnp.stack(
        [joint_poses(jnp.asarray(own.hardware["chain_pos"][0]), rotations, q)[0][-1] for q in jnp.asarray(poses)]
    )
    points = jnp.asarray(list(itertools.product(*GRID)))
    assert float(jnp.linalg.norm(reached[:, None] - points, axis=-1).min(axis=1).max()) < 0.011
    low, high = np.moveaxis(own.hardware["joint_range"][0, :5], -1, 0)
    angles = own.hardware["start_angles"][0, :, :5]
    assert ((angles >= low - 1e-6) & (angles <= high + 1e-6)).all()


def test_an_arm_that_reaches_nothing_is_refused(tmp_path):
    (tmp_path / "short.urdf").write_text(arm(2))
    short = read_robot_here(tmp_path / "short.urdf", None, None)
    with pytest.raises(RobotFileError, match="the arm from l0 to l2 reaches no point that the reacher starts from"):
        make_own_pool("reacher", short)


def test_what_was_noted_is_said_of_an_arm_that_reaches_nothing_too(tmp_path, capsys):
    (tmp_path / "short.urdf").write_text(arm(2))
    with pytest.raises(SystemExit) as exit_info:
        robot.main(["check", str(tmp_path / "short.urdf")])
    shown = capsys.readouterr()
    assert exit_info.value.code == 2
    assert "note: armature assumed [kg m^2]: j0 0.1, j1 0.1" in shown.out
    assert shown.err.startswith("the arm from l0 to l2 reaches no point")


def test_the_command_says_joints_assumptions_and_what_lies_outside(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(TEMPLATE.read_text().replace(' damping="15"', "", 1))
    robot.main(["check", str(tmp_path / "arm.xml"), "--tip", "l6", "--json", str(tmp_path / "out.json")])
    shown, record = capsys.readouterr().out, json.loads((tmp_path / "out.json").read_text())
    assert record["notes"] == ["damping assumed [N m s/rad]: j0 1"]
    assert "note: damping assumed [N m s/rad]: j0 1" in shown
    assert "world to l6: 7 joints" in shown
    assert [joint["name"] for joint in record["joints"]] == [f"j{i}" for i in range(7)]
    assert record["nearest"]["type"] == "I"
    assert "nearest training arm: type I" in shown
    outside = [entry["name"] for entry in record["entries"] if not entry["is_inside"]]
    assert f"{len(outside)} of {len(record['entries'])} entries" in shown


def test_brackets_in_names_and_units_are_shown(tmp_path, capsys):
    text = TEMPLATE.read_text().replace('"j3"', '"j[/x]3"')
    (tmp_path / "arm.xml").write_text(text)
    robot.main(["check", str(tmp_path / "arm.xml"), "--tip", "l6"])
    shown = capsys.readouterr().out
    assert "j[/x]3" in shown
    assert "z [rad]" in shown


def test_the_arms_own_file_is_not_written_over(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(TEMPLATE.read_text())
    with pytest.raises(SystemExit) as exit_info:
        robot.main(["check", str(tmp_path / "arm.xml"), "--tip", "l6", "--json", str(tmp_path / "arm.xml")])
    assert exit_info.value.code == 2
    assert "exists: expected a new file, or one that ends in .json" in capsys.readouterr().err
    assert (tmp_path / "arm.xml").read_text() == TEMPLATE.read_text()


def test_the_arms_to_compare_with_are_those_of_a_policy(finished_arms, finished_run, tmp_path, capsys):
    arguments = ["check", str(TEMPLATE), "--tip", "l6", "--json", str(tmp_path / "out.json")]
    robot.main([*arguments, "--policy", str(finished_arms)])
    nearest = json.loads((tmp_path / "out.json").read_text())["nearest"]
    assert nearest["type"] in ("A", "I")
    assert nearest["robot_id"] % 10_000 < 2  # it was trained on two of each
    with pytest.raises(SystemExit):
        robot.main([*arguments, "--policy", str(finished_run)])
    assert "expected one that was trained on types of arms" in capsys.readouterr().err


def test_a_joint_that_no_training_arm_has_lies_outside(trained):
    shorter = trained.subset(np.flatnonzero(trained.hardware["joint_mask"].sum(axis=1) < 7))
    entries = compare_with(make_own_pool("reacher", load_robot("panda")), shorter)
    seventh = [entry for entry in entries if entry.name.startswith("joint 6 ")]
    assert len(seventh) > 5
    assert not any(entry.is_inside or entry.low is not None for entry in seventh)


def test_a_long_tool_and_a_displaced_mass_lie_outside(one_of_them, trained):
    chain = one_of_them.chain
    far = dataclasses.replace(chain, pos=chain.pos + np.eye(len(chain.pos))[:, -1:], com=chain.com + 1.0)
    entries = compare_with(make_own_pool("peg_insertion", dataclasses.replace(one_of_them, chain=far)), trained)
    outside = {entry.name for entry in entries if not entry.is_inside}
    assert {"tip position x", "tip position y", "tip position z", "joint 0 centre of mass x"} <= outside
    assert "joint 0 position x" not in outside


def test_an_arm_from_a_file_is_zero_shot_whatever_its_file_is_called(finished_arms, tmp_path):
    path = shutil.copy(TEMPLATE, tmp_path / "A.xml")
    evaluate.main([str(finished_arms), "--robot", str(path), "--tip", "l6", "--trials", "1", "--robots-per-trial", "1",
                   "--json", str(tmp_path / "out.json")])  # fmt: skip
    assert json.loads((tmp_path / "out.json").read_text())["types"]["A"]["zero_shot"]


def test_a_policy_is_evaluated_on_ones_own_arm(finished_arms, tmp_path):
    arguments = ["--robot", str(TEMPLATE), "--tip", "l6", "--trials", "2", "--robots-per-trial", "3"]
    evaluate.main([str(finished_arms), *arguments, "--json", str(tmp_path / "out.json")])
    record = json.loads((tmp_path / "out.json").read_text())
    assert list(record["types"]) == ["arm_reacher"]
    assert record["types"]["arm_reacher"]["zero_shot"]
    assert len(record["robots"]) == 6


@pytest.mark.parametrize("others", [["--types", "A"], ["--pool", "folder"]])
def test_ones_own_arm_goes_without_others(others, finished_arms, capsys):
    with pytest.raises(SystemExit) as exit_info:
        evaluate.main([str(finished_arms), "--robot", str(TEMPLATE), *others])
    assert exit_info.value.code == 2
    assert "--robot: goes with" in capsys.readouterr().err

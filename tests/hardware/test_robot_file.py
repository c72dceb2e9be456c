import dataclasses
import random

import numpy as np
import pytest
from robot_texts import MJCF, arm, joint, link, robot

from hcp_jax.hardware.own_arm import make_own_pool, make_own_variants
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.hardware.robot_file import ASSUMED_TORQUE_LIMITS, RobotFileError, read_robot, read_robot_here

BOMB = '<?xml version="1.0"?><!DOCTYPE b [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"/>'
FORK = robot(*(link(f"l{i}") for i in range(3)), joint("j0", "l0", "l1"), joint("j1", "l0", "l2"))
GRIPPER = robot(
    *(link(f"l{i}") for i in range(4)),
    joint("j0", "l0", "l1"),
    joint("f0", "l1", "l2", kind="prismatic"),
    joint("f1", "l1", "l3", kind="prismatic"),
)
OUTSIDE = '<mujoco><asset><mesh name="m" file="../../secret.stl"/></asset><worldbody/></mujoco>'
BAD = {
    "not XML": ("I am no robot", "not XML"),
    "empty": ("", "not XML"),
    "of another kind": ("<svg/>", "expected <robot>"),
    "an XML bomb": (BOMB, "document type declaration"),
    "branching": (FORK, "branches: to l[12] and to l[12]; choose one end with --tip"),
    "too long": (arm(8), "8 hinges between base and tip: expected 1 to 7"),
    "without joints": (robot(link("l0")), "no hinge joints"),
    "with a prismatic joint": (
        robot(*(link(f"l{i}") for i in range(4)), joint("j0", "l0", "l1"), joint("p", "l1", "l2", kind="prismatic"),
              joint("j1", "l2", "l3")),
        "joint p: is prismatic",
    ),
    "without limits": (arm(limit=""), "joint j0: revolute with limits 0 to 0: expected a lower and a larger upper one"),
    "with limits the wrong way round": (arm(limit='<limit lower="2" upper="-2"/>'), "revolute with limits 2 to -2"),
    "with a limit that is no number": (arm(limit='<limit lower="nan" upper="1"/>'), "revolute with limits nan to 1"),
    "with a joint that follows another": (
        arm(3).replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="j2"/>', 2),
        "joint j0: follows j2; expected independent joints",
    ),
    "with a constraint between joints": (
        MJCF.replace("<compiler", '<equality><joint joint1="j1" joint2="j0"/></equality><compiler'),
        "joint j1: follows j0; expected independent joints",
    ),
    "a xacro template": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="a" value="1"/></robot>',
        "is a xacro template",
    ),
    "without mass": (
        robot(link("l0"), '<link name="l1"/>', joint("j0", "l0", "l1")),
        "link l1: moves and has no mass",
    ),
    "of zero inertia": (
        robot(link("l0"), link("l1", inertia='<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'),
              joint("j0", "l0", "l1")),
        "mass and inertia of moving bodies must be larger",
    ),
    "with a mesh outside its folder": (OUTSIDE, "outside the file's folder"),
}  # fmt: skip


def write(folder, text: str):
    path = folder / "robot.xml"
    path.write_text(text)
    return path


def test_urdf_and_mjcf_of_one_arm_give_the_same_chain(tmp_path):
    urdf = read_robot(write(tmp_path, arm()))
    mjcf = read_robot(write(tmp_path, MJCF))
    assert urdf.joints == mjcf.joints == ("j0", "j1")
    assert (urdf.base, urdf.tip) == (mjcf.base, mjcf.tip) == ("l0", "l2")
    for field in dataclasses.fields(urdf.chain):
        one, other = getattr(urdf.chain, field.name), getattr(mjcf.chain, field.name)
        if field.name != "inertia_quat":  # of equal principal axes there are several
            np.testing.assert_allclose(one, other, atol=1e-9, err_msg=field.name)
    np.testing.assert_allclose(urdf.chain.torque_limit, 20.0)
    np.testing.assert_allclose(urdf.chain.joint_range, [[-1.5, 1.5]] * 2)
    np.testing.assert_allclose(urdf.chain.damping, 0.5)
    np.testing.assert_allclose(urdf.chain.frictionloss, 0.1)
    assert "meshes that are missing: m" in mjcf.notes


@pytest.mark.parametrize("kind", BAD)
def test_what_is_no_serial_arm_is_said_in_one_line(kind, tmp_path):
    text, message = BAD[kind]
    with pytest.raises(RobotFileError, match=message) as error:
        read_robot_here(write(tmp_path, text), None, None)
    assert "\n" not in str(error.value)


def test_a_missing_file_a_name_twice_and_a_missing_tip_are_said(tmp_path):
    with pytest.raises(RobotFileError, match="No such file"):
        read_robot(tmp_path / "nothing.urdf")
    with pytest.raises(RobotFileError, match="repeated name 'j0' in joint"):
        read_robot(write(tmp_path, arm().replace('"j1"', '"j0"')))
    for name in ("hand", "world"):
        with pytest.raises(RobotFileError, match=f"--tip={name}: no such link; there are l0, l1, l2"):
            read_robot(write(tmp_path, arm()), tip=name)


def test_why_reading_ended_without_an_answer_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "mujoco.py").write_text("raise RuntimeError('no such library')")
    with pytest.raises(RobotFileError, match=r"without an answer \(exit code 1\): RuntimeError: no such library"):
        read_robot(write(tmp_path, arm()))


@pytest.mark.parametrize("seed", range(10))
def test_a_flat_link_may_be_turned_in_any_way(seed, tmp_path):
    """Its largest moment of inertia is the sum of the others, which rounding leaves on either side."""
    turn = " ".join(f"{angle:.4f}" for angle in np.random.default_rng(seed).uniform(-3, 3, 3))
    text = arm().replace('<origin xyz="0 0 0.1"/>', f'<origin xyz="0 0 0.1" rpy="{turn}"/>')
    read = read_robot_here(write(tmp_path, text), None, None)
    np.testing.assert_allclose(read.chain.inertia, [[0.03, 0.02, 0.01]] * 2, rtol=1e-6)
    assert not [note for note in read.notes if "inertia" in note]
    make_own_pool("peg_insertion", read)
    make_own_variants("peg_insertion", read, ArmRanges(), 5, seed)


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_an_inertia_that_is_too_large_by_its_digits_is_lowered_and_said(form, tmp_path):
    text = arm().replace('izz="0.03"', 'izz="0.0302"') if form == "urdf" else MJCF.replace("0.01 0.02 0.03", "0.01 0.02 0.0302")
    read = read_robot_here(write(tmp_path, text), None, None)
    np.testing.assert_allclose(read.chain.inertia, [[0.03, 0.02, 0.01]] * 2, rtol=1e-6)
    assert "inertia of link l1 lowered by 0.66 %: it was above what a body can have (A + B >= C)" in read.notes
    with pytest.raises(RobotFileError, match=r"inertia must satisfy A \+ B >= C"):
        read_robot_here(write(tmp_path, text.replace("0.0302", "0.04")), None, None)


def test_fingers_are_fixed_and_a_fork_needs_a_tip(tmp_path):
    gripper = read_robot_here(write(tmp_path, GRIPPER), None, None)
    assert (gripper.joints, gripper.tip) == (("j0",), "l1")
    assert "joints fixed at 0: f0, f1" in gripper.notes
    np.testing.assert_allclose(gripper.chain.mass, [3.0])
    fork = read_robot_here(write(tmp_path, FORK), None, "l2")
    assert fork.joints == ("j1",)


def test_from_a_base_on_joints_before_it_are_fixed_and_it_stands_at_the_origin(tmp_path):
    robot_file = read_robot_here(write(tmp_path, arm(3)), "l1", None)
    assert robot_file.joints == ("j1", "j2")
    np.testing.assert_allclose(robot_file.chain.pos[0], [0, 0, 0.3], atol=1e-9)
    assert "joints fixed at 0: j0" in robot_file.notes


def test_what_a_file_leaves_open_is_assumed_and_said(tmp_path):
    open_limit = '<limit lower="-1" upper="1"/>'
    text = arm(kind="continuous", limit=open_limit).replace(' damping="0.5"', "", 1)
    robot_file = read_robot_here(write(tmp_path, text), None, None)
    assert any(note.startswith("continuous joints limited") for note in robot_file.notes)
    assert any(note.startswith("torque limits assumed [N m]: j0 80, j1 80") for note in robot_file.notes)
    assert "damping assumed [N m s/rad]: j0 1" in robot_file.notes
    assert "armature assumed [kg m^2]: j0 0.1, j1 0.1" in robot_file.notes
    np.testing.assert_allclose(robot_file.chain.torque_limit, 80.0)
    np.testing.assert_allclose(robot_file.chain.damping, [1.0, 0.5])
    np.testing.assert_allclose(robot_file.chain.joint_range, [[-np.pi, np.pi]] * 2)


def test_forces_that_a_chain_does_not_have_are_said(tmp_path):
    text = MJCF.replace('name="j0"', 'name="j0" stiffness="3"').replace('name="l2"', 'name="l2" gravcomp="1"')
    notes = read_robot_here(write(tmp_path, text.replace("<compiler", '<option gravity="0 0 0"/><compiler')), None, None).notes
    assert "springs of joints left out: j0" in notes
    assert "gravity compensation of links left out: l2" in notes
    assert any(note.startswith("gravity of the file left out: 0 0 0") for note in notes)
    assert not any("left out" in note for note in read_robot_here(write(tmp_path, MJCF), None, None).notes)


def test_pictures_may_be_missing(tmp_path):
    wood = '<asset><texture name="w" type="2d" file="wood.png"/><material name="w" texture="w"/>'
    text = MJCF.replace("<asset>", wood).replace('<geom type="mesh" mesh="m"/>', '<geom size="0.1" material="w"/>')
    np.testing.assert_array_equal(read_robot(write(tmp_path, text)).chain.mass, read_robot(write(tmp_path, MJCF)).chain.mass)


def test_bodies_and_joints_may_be_without_a_name(tmp_path):
    text = MJCF
    for name in ("l0", "l1", "l2", "j0", "j1"):
        text = text.replace(f' name="{name}"', "")
    text = text[: text.index("<actuator>")] + "</mujoco>"
    read, named = read_robot(write(tmp_path, text)), read_robot(write(tmp_path, MJCF))
    assert (read.joints, read.base, read.tip) == (("body2", "body3"), "body1", "body3")
    np.testing.assert_allclose(read.chain.pos, named.chain.pos)


@pytest.mark.parametrize(
    ("actuator", "expected"),
    [
        ('<motor joint="j0" ctrlrange="-20 20" ctrllimited="true"/>', 20.0),
        ('<motor joint="j0" gear="50" ctrlrange="-1 1" ctrllimited="true" forcerange="-2 2" forcelimited="true"/>', 50.0),
        ('<position joint="j0" kp="2000" ctrlrange="-3 3" ctrllimited="true"/>', ASSUMED_TORQUE_LIMITS[0]),
        ('<position joint="j0" kp="2000" forcerange="-30 30" forcelimited="true"/>', 30.0),
    ],
)
def test_a_torque_limit_is_what_the_motor_can_give_and_not_what_a_servo_is_told(actuator, expected, tmp_path):
    text = MJCF.replace('<motor joint="j0" ctrlrange="-20 20" ctrllimited="true"/>', actuator)
    assert read_robot(write(tmp_path, text)).chain.torque_limit[0] == expected
    capped = text.replace('name="j0"', 'name="j0" actuatorfrcrange="-5 5" actuatorfrclimited="true"')
    assert read_robot(write(tmp_path, capped)).chain.torque_limit[0] == 5.0


@pytest.mark.slow
def test_three_hundred_damaged_files_are_read_or_refused_in_one_line(tmp_path):
    """pytest -m slow tests/hardware/test_robot_file.py (a minute and a half)"""
    real = [(robots_path() / name).read_text() for name in ("catalogue/panda.urdf", "arm_peg.xml")]
    draw, outcomes = random.Random(0), {"read": 0, "refused": 0}
    for number in range(300):
        text = list(draw.choice([arm(3), MJCF, GRIPPER, FORK, arm(7), *real]))
        for _ in range(draw.choice([1, 3, 10, 40])):
            place = draw.randrange(len(text))
            what = draw.random()
            if what < 0.3:
                del text[place : place + draw.choice([1, 5, 50])]
            elif what < 0.6:
                text[place] = draw.choice(["", "<", ">", '"', "9", "-", "e", "\x00", "nan", "1e999", "../", "é"])
            elif what < 0.8:
                text[place:place] = text[draw.randrange(len(text)) :][: draw.choice([5, 80, 400])]
            else:
                text = text[:place] if draw.random() < 0.2 else text
            text = text or ["<"]
        path = tmp_path / f"{number}.xml"
        path.write_text("".join(text))
        message = try_to_read(path)
        outcomes["read" if message is None else "refused"] += 1
        assert "\n" not in (message or "")
        assert "without an answer" not in (message or ""), f"{path}: MuJoCo crashed"
        assert "not read within" not in (message or "")
    assert min(outcomes.values()) > 10, outcomes


def try_to_read(path) -> str | None:
    """What the file is refused for."""
    try:
        read_robot(path)
    except RobotFileError as error:
        return str(error)


def test_what_a_file_includes_is_held_to_the_same_rules(tmp_path):
    (tmp_path / "arm.xml").write_text('<mujoco><include file="part.xml"/><worldbody/></mujoco>')
    (tmp_path / "part.xml").write_text(BOMB)
    with pytest.raises(RobotFileError, match="document type declaration"):
        read_robot_here(tmp_path / "arm.xml", None, None)
    (tmp_path / "part.xml").write_text("<mujocoinclude>")
    with pytest.raises(RobotFileError, match="not XML"):
        read_robot_here(tmp_path / "arm.xml", None, None)

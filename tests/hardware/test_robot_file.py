import dataclasses
import random

import mujoco
import numpy as np
import pytest
from robot_texts import MJCF, arm, joint, link, robot

from hcp_jax.hardware.chain import Chain, read_chain
from hcp_jax.hardware.own_arm import make_own_pool, make_own_variants
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.hardware.robot_checks import ASSUMED_TORQUE_LIMITS
from hcp_jax.hardware.robot_file import RobotFileError, read_robot, read_robot_here

BOMB = '<?xml version="1.0"?><!DOCTYPE b [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"/>'
FORK = robot(*(link(f"l{i}") for i in range(3)), joint("j0", "l0", "l1"), joint("j1", "l0", "l2"))
GRIPPER = robot(
    *(link(f"l{i}") for i in range(4)),
    joint("j0", "l0", "l1"),
    joint("f0", "l1", "l2", kind="prismatic"),
    joint("f1", "l1", "l3", kind="prismatic"),
)
MESH = '<asset><mesh name="m" file="secret.stl"/></asset>'
ATTACH = '<mujoco><asset><model name="m" file="sub/part.xml"/></asset></mujoco>'
# What a robot's file says, and sub/part.xml.
OUTSIDE = {
    "a mesh": (f"<mujoco>{MESH.replace('secret', '../../secret')}</mujoco>", ""),
    "a picture": ('<mujoco><asset><texture name="t" type="cube" fileright="../secret.png"/></asset></mujoco>', ""),
    "the second compiler": (f'<mujoco><compiler meshdir="a"/><compiler meshdir=".."/>{MESH}</mujoco>', ""),
    "the first of two compilers": (f'<mujoco><compiler meshdir=".."/><compiler texturedir="a"/>{MESH}</mujoco>', ""),
    "an included compiler": (
        f'<mujoco><compiler meshdir="a"/><include file="sub/part.xml"/>{MESH}</mujoco>',
        '<mujoco><compiler assetdir=".."/></mujoco>',
    ),
    "an included file": (
        '<mujoco><include xmlns="a" file="sub/part.xml"/></mujoco>',
        f'<mujoco><compiler meshdir=".."/>{MESH}</mujoco>',
    ),
    "a file that is included beside another": (
        f'<mujoco><include file="sub/part.xml"/>{MESH}</mujoco>',
        '<mujoco><include file="more.xml"/></mujoco>',
    ),
    "an attached file": (ATTACH, f'<mujoco><compiler meshdir="../.."/>{MESH}</mujoco>'),
    "a file that an attached one includes": (ATTACH, f'<mujoco><include file="more.xml"/>{MESH}</mujoco>'),
}
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
    "with a loop": (
        MJCF.replace("<compiler", '<equality><weld body1="l1" body2="l2"/></equality><compiler'),
        "link l1: is tied to l2 by a constraint; expected an open chain",
    ),
    "with a tip that is held": (
        MJCF.replace("<compiler", '<equality><connect body1="l2" anchor="0 0 0"/></equality><compiler'),
        "link l2: is tied to world by a constraint; expected an open chain",
    ),
    "with a loop from site to site": (
        MJCF.replace("<compiler", '<equality><connect site1="s1" site2="s2"/></equality><compiler')
        .replace('<joint name="j0"', '<site name="s1"/><joint name="j0"')
        .replace('<joint name="j1"', '<site name="s2"/><joint name="j1"'),
        "link l1: is tied to l2 by a constraint; expected an open chain",
    ),
    "with a constraint of what is not there": (
        MJCF.replace("<compiler", '<equality><weld body1="hand"/></equality><compiler'),
        "constraint of hand and world: there is no body of that name",
    ),
    "a xacro template": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="a" value="1"/></robot>',
        "is a xacro template",
    ),
    "without mass": (
        robot(link("l0"), '<link name="l1"/>', joint("j0", "l0", "l1")),
        "link l1: moves and has no mass",
    ),
    "with mass after the next joint alone": (
        robot(link("l0"), '<link name="l1"/>', link("l2"), joint("j0", "l0", "l1"), joint("j1", "l1", "l2")),
        "link l1: moves and has no mass",
    ),
    "of zero inertia": (
        robot(link("l0"), link("l1", inertia='<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'),
              joint("j0", "l0", "l1")),
        "mass and inertia of moving bodies must be larger",
    ),
}  # fmt: skip


INERTIAL = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/>'
GEOM = '<geom type="mesh" mesh="m"/>'


def write(folder, text: str):
    path = folder / "robot.xml"
    path.write_text(text)
    return path


def check_same_chain(one: Chain, other: Chain) -> None:
    for field in dataclasses.fields(Chain):
        if field.name != "inertia_quat":  # of equal principal axes there are several
            np.testing.assert_allclose(getattr(one, field.name), getattr(other, field.name), atol=1e-9, err_msg=field.name)


def test_urdf_and_mjcf_of_one_arm_give_the_same_chain(tmp_path):
    urdf = read_robot(write(tmp_path, arm()))
    mjcf = read_robot(write(tmp_path, MJCF))
    assert urdf.joints == mjcf.joints == ("j0", "j1")
    assert (urdf.base, urdf.tip) == (mjcf.base, mjcf.tip) == ("l0", "l2")
    check_same_chain(urdf.chain, mjcf.chain)
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


def test_a_single_finger_is_fixed_too(tmp_path):
    links = (link(f"l{i}") for i in range(5))
    palm = joint("palm", "l1", "l2", kind="fixed")
    finger = joint("f0", "l2", "l3", kind="prismatic"), joint("nail", "l3", "l4", kind="fixed")
    read = read_robot_here(write(tmp_path, robot(*links, joint("j0", "l0", "l1"), palm, *finger)), None, None)
    assert (read.joints, read.tip) == (("j0",), "l2")
    assert "joints fixed where the file has them: f0" in read.notes
    np.testing.assert_allclose(read.chain.mass, [4.0])


def test_fingers_are_fixed_and_a_fork_needs_a_tip(tmp_path):
    gripper = read_robot_here(write(tmp_path, GRIPPER), None, None)
    assert (gripper.joints, gripper.tip) == (("j0",), "l1")
    assert "joints fixed where the file has them: f0, f1" in gripper.notes
    np.testing.assert_allclose(gripper.chain.mass, [3.0])
    fork = read_robot_here(write(tmp_path, FORK), None, "l2")
    assert fork.joints == ("j1",)


def test_from_a_base_on_joints_before_it_are_fixed_and_it_stands_at_the_origin(tmp_path):
    robot_file = read_robot_here(write(tmp_path, arm(3)), "l1", None)
    assert robot_file.joints == ("j1", "j2")
    np.testing.assert_allclose(robot_file.chain.pos[0], [0, 0, 0.3], atol=1e-9)
    assert "joints fixed where the file has them: j0" in robot_file.notes


@pytest.mark.parametrize(("turn", "tilt"), [("1.5708 0 0", 90), ("0 0 1", 0), ("0.5236 0 1", 30)])
def test_a_base_that_is_turned_in_the_file_stands_upright_and_a_tilt_is_said(turn, tilt, tmp_path):
    text = arm(3).replace('rpy="0 0 0"', f'rpy="{turn}"', 1)
    straight, turned = (read_robot_here(write(tmp_path, form), "l1", None) for form in (arm(3), text))
    check_same_chain(straight.chain, turned.chain)
    said = f"base l1 is turned by {tilt} degrees against the file's world: gravity then pulls along the base's -z"
    assert [note for note in turned.notes if "turned" in note] == ([said] if tilt else [])
    assert not any("turned" in note for note in straight.notes)


@pytest.mark.parametrize(
    ("joint", "base"), [("", "l0"), ("<freejoint/>", "l0"), ('<joint range="-1 1" limited="true"/>', "world")]
)
def test_an_arm_whose_first_body_turns_stands_on_the_world(joint, base, tmp_path):
    path = write(tmp_path, MJCF.replace('<body name="l0">', f'<body name="l0">{joint}'))
    assert read_robot_here(path, None, None).base == base
    assert read_robot_here(path, "l0", None).base == "l0"


def test_a_base_may_be_a_link_that_the_file_would_have_fused(tmp_path):
    text = MJCF.replace("<compiler", '<compiler fusestatic="true"')
    fused, whole = (read_robot_here(write(tmp_path, form), "l0", None) for form in (text, MJCF))
    np.testing.assert_array_equal(fused.chain.pos, whole.chain.pos)


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


HAND = '<body name="palm"><body name="finger"><joint name="f" type="slide"/></body></body>'


@pytest.mark.parametrize(
    "constraint",
    [
        '<weld body1="palm" body2="finger"/>',
        '<connect body1="finger" body2="l2" anchor="0 0 0"/>',
        '<weld body1="l0"/>',
        '<weld body1="l1" body2="l2" active="false"/>',
        '<joint joint1="j1" joint2="j0" active="false"/>',
        '<joint joint1="f" joint2="j1"/>',
    ],
)
def test_a_constraint_of_what_moves_together_or_that_is_off_does_no_harm(constraint, tmp_path):
    text = MJCF.replace("</body></body></body></worldbody>", f"{HAND}</body></body></body></worldbody>")
    one, other = (
        read_robot_here(write(tmp_path, text.replace("<compiler", f"<equality>{held}</equality><compiler")), None, None)
        for held in (constraint, "")
    )
    assert (one.joints, one.tip, one.notes) == (other.joints, other.tip, other.notes)


def test_what_holds_the_arm_from_outside_and_tendons_are_left_out_and_said(tmp_path):
    hand = '<body name="mocap" mocap="true"><site name="s"/></body></worldbody>'
    more = '<tendon><fixed name="t"><joint joint="j0" coef="1"/></fixed></tendon><compiler'
    text = MJCF.replace("</worldbody>", hand).replace(
        "<compiler", f'<equality><weld body1="mocap" body2="l2"/></equality>{more}'
    )
    notes = read_robot_here(write(tmp_path, text), None, None).notes
    assert "constraint to a mocap body left out: mocap to l2" in notes
    assert "tendons left out: t" in notes


def test_pictures_may_be_missing(tmp_path):
    wood = '<asset><texture name="w" type="2d" file="wood.png"/><material name="w" texture="w"/>'
    text = MJCF.replace("<asset>", wood).replace('<geom type="mesh" mesh="m"/>', '<geom size="0.1" material="w"/>')
    np.testing.assert_array_equal(read_robot(write(tmp_path, text)).chain.mass, read_robot(write(tmp_path, MJCF)).chain.mass)


@pytest.mark.parametrize(
    ("inertial", "mesh", "compiler", "is_said"),
    [
        ("", "", "", True),
        ("", 'mass="2"', "", True),
        ("", 'mass="0"', "", False),
        ("", 'density="0"', "", False),
        ("", 'group="3"', 'inertiagrouprange="0 2"', False),
        (INERTIAL, "", "", False),
        (INERTIAL, "", 'inertiafromgeom="true"', True),
    ],
)
def test_a_mass_without_its_missing_meshes_is_said(inertial, mesh, compiler, is_said, tmp_path):
    text = MJCF.replace("<compiler", f"<compiler {compiler}").replace(' name="l1"', "")
    text = text.replace(f"{INERTIAL}{GEOM}", f'{inertial}<geom size="0.1"/>{GEOM.replace("/>", f" {mesh}/>")}')
    notes = read_robot_here(write(tmp_path, text), None, None).notes
    assert ("mass of link body1 without its missing meshes: m" in notes) == is_said
    assert "meshes that are missing: m" in notes


def test_inertias_come_from_geoms_where_the_file_says_so(tmp_path):
    text = MJCF.replace(INERTIAL, f'{INERTIAL}<geom size="0.1" mass="3"/>')
    read = read_robot_here(write(tmp_path, text.replace("<compiler", '<compiler inertiafromgeom="true"')), None, None)
    np.testing.assert_allclose(read.chain.mass, 3.0)
    np.testing.assert_allclose(read_robot_here(write(tmp_path, text), None, None).chain.mass, 1.0)


def test_a_massless_link_may_carry_what_has_mass(tmp_path):
    parts = link("l0"), '<link name="l1"/>', '<link name="l2"/>', link("l3", mass=2.0)
    fixed = (joint(f"fixed{i}", f"l{i}", f"l{i + 1}", kind="fixed") for i in (1, 2))
    read = read_robot_here(write(tmp_path, robot(*parts, joint("j0", "l0", "l1"), *fixed)), None, None)
    np.testing.assert_allclose(read.chain.mass, 2.0)


def test_bodies_and_joints_may_be_without_a_name(tmp_path):
    text = MJCF
    for name in ("l0", "l1", "l2", "j0", "j1"):
        text = text.replace(f' name="{name}"', "")
    text = text[: text.index("<actuator>")] + "</mujoco>"
    read, named = read_robot(write(tmp_path, text)), read_robot(write(tmp_path, MJCF))
    assert (read.joints, read.base, read.tip) == (("body2", "body3"), "body1", "body3")
    np.testing.assert_allclose(read.chain.pos, named.chain.pos)


@pytest.mark.parametrize(
    ("actuators", "expected"),
    [
        ('<motor joint="j0" ctrlrange="-20 20" ctrllimited="true"/>', 20.0),
        ('<motor joint="j0" gear="50" ctrlrange="-1 1" ctrllimited="true" forcerange="-2 2" forcelimited="true"/>', 50.0),
        ('<motor joint="j0" gear="50" ctrlrange="-1 1" ctrllimited="true" forcerange="-.5 .5" forcelimited="true"/>', 25.0),
        ('<motor joint="j0" gear="30"/>', ASSUMED_TORQUE_LIMITS[0]),
        ('<position joint="j0" kp="2000" ctrlrange="-3 3" ctrllimited="true"/>', ASSUMED_TORQUE_LIMITS[0]),
        ('<position joint="j0" kp="2000" forcerange="-30 30" forcelimited="true"/>', 30.0),
        ('<velocity joint="j0"/><motor joint="j0"/><motor joint="j0" ctrlrange="-7 7" ctrllimited="true"/>'
         '<motor joint="j0" ctrlrange="-9 9" ctrllimited="true"/>', 9.0),
    ],
)  # fmt: skip
def test_a_torque_limit_is_what_the_motors_can_give_and_not_what_a_servo_is_told(actuators, expected, tmp_path):
    text = MJCF.replace('<motor joint="j0" ctrlrange="-20 20" ctrllimited="true"/>', actuators)
    read = read_robot_here(write(tmp_path, text), None, None)
    assert read.chain.torque_limit[0] == expected
    assert any("torque limits assumed" in note for note in read.notes) == (expected == ASSUMED_TORQUE_LIMITS[0])
    capped = text.replace('name="j0"', 'name="j0" actuatorfrcrange="-5 5" actuatorfrclimited="true"')
    assert read_robot_here(write(tmp_path, capped), None, None).chain.torque_limit[0] == 5.0


def test_the_motor_of_a_tendon_says_nothing_of_the_joint_of_that_number():
    tendon = '<tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon>'
    text = MJCF.replace('<motor joint="j0"', '<motor tendon="t"').replace("<actuator>", f"{tendon}<actuator>")
    text = text.replace('<joint name="j1"', '<site name="ref_pt"/><joint name="j1"')
    text = text.replace(MJCF[MJCF.index("<asset>") : MJCF.index("</asset>")], "<asset>").replace(GEOM, "")
    np.testing.assert_array_equal(read_chain(mujoco.MjModel.from_xml_string(text)).torque_limit, [0.0, 20.0])


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


@pytest.mark.parametrize("kind", OUTSIDE)
def test_what_a_file_refers_to_is_in_its_folder(kind, tmp_path):
    (tmp_path / "arm" / "sub").mkdir(parents=True)
    text, part = OUTSIDE[kind]
    (tmp_path / "arm" / "sub" / "part.xml").write_text(part)
    (tmp_path / "arm" / "sub" / "more.xml").write_text('<mujoco><compiler meshdir="../.."/></mujoco>')
    with pytest.raises(RobotFileError, match="is outside the file's folder"):
        read_robot_here(write(tmp_path / "arm", text), None, None)


def test_an_attached_files_references_are_relative_to_it(tmp_path):
    (tmp_path / "sub").mkdir()
    part = MJCF.replace("meshes/missing", "../missing")
    (tmp_path / "sub" / "part.xml").write_text(part)
    attached = '<worldbody><body name="stand"><attach model="m" body="l0" prefix="p_"/></body></worldbody></mujoco>'
    read = read_robot_here(write(tmp_path, ATTACH.replace("</mujoco>", attached)), None, None)
    assert (read.base, read.joints) == ("stand", ("p_j0", "p_j1"))


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ('<mujoco><asset><model name="m" file="part.xml"/></asset></mujoco>', "<model file='part.xml'> attaches itself"),
        ('<mujoco><asset><model name="m" file="../robot.xml"/></asset></mujoco>', "<model file='robot.xml'> attaches itself"),
        (arm(), "<model file='part.xml'> starts with <robot>: expected <mujoco>"),
        (BOMB, "document type declaration"),
    ],
)
def test_a_file_that_cannot_be_attached_is_refused_before_mujoco_reads_it(part, message, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "part.xml").write_text(part)
    with pytest.raises(RobotFileError, match=message):
        read_robot_here(write(tmp_path, ATTACH), None, None)


def test_what_a_file_includes_is_held_to_the_same_rules(tmp_path):
    (tmp_path / "arm.xml").write_text('<mujoco><include file="part.xml"/><worldbody/></mujoco>')
    (tmp_path / "part.xml").write_text(BOMB)
    with pytest.raises(RobotFileError, match="document type declaration"):
        read_robot_here(tmp_path / "arm.xml", None, None)
    (tmp_path / "part.xml").write_text("<mujocoinclude>")
    with pytest.raises(RobotFileError, match="not XML"):
        read_robot_here(tmp_path / "arm.xml", None, None)

import dataclasses

import mujoco
import numpy as np
import pytest

from hcp_jax.hardware.arm import REMOVED_JOINTS, TYPES, arm_spec, sample_hardware
from hcp_jax.hardware.arm_pool import CHAIN_TEMPLATES, make_arm_pool, make_chain_pool
from hcp_jax.hardware.chain import ChainError, read_chain
from hcp_jax.hardware.pool import PoolError, RobotPool, robots_path
from hcp_jax.hardware.ranges import ArmRanges, nominal_lengths


def drawn_arm(task: str, robot_type: str) -> mujoco.MjSpec:
    """One variant with its own joints."""
    hardware = {name: values[0] for name, values in sample_hardware(ArmRanges(), robot_type, 1, seed=3).items()}
    return arm_spec(task, robot_type, hardware)


def padded(model: mujoco.MjModel, task: str) -> RobotPool:
    """A pool of that one arm."""
    return make_chain_pool(CHAIN_TEMPLATES[task], [read_chain(model)], np.zeros(1), np.zeros(1), np.zeros((1, 1, 7)))


def with_table(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Gives an arm the table and the colliding shapes of the chain template."""
    chain = mujoco.MjSpec.from_file(str(robots_path() / CHAIN_TEMPLATES["peg_insertion"]))
    contact = {name: getattr(chain.geom("peg"), name) for name in ("condim", "friction", "margin", "solref", "solimp")}
    site, source = spec.site("ref_pt"), chain.body("tool")
    inertial = {name: getattr(source, name) for name in ("mass", "ipos", "iquat", "inertia", "explicitinertial")}
    tool = site.parent.add_body(name="tool", pos=site.pos, quat=site.quat, **inertial)
    for geom in source.geoms:
        tool.add_geom(type=geom.type, size=geom.size, fromto=geom.fromto, mass=0, contype=1, conaffinity=0, **contact)
    table = spec.worldbody.add_body(name="table", pos=chain.body("table").pos)
    for box in chain.body("table").geoms:
        table.add_geom(type=box.type, size=box.size, pos=box.pos, contype=0, conaffinity=1, **contact)
    return spec


def shake(model: mujoco.MjModel, num_joints: int) -> tuple[np.ndarray, int]:
    """Joint angles after 1 s of random torques at 0.5 ms, solved exactly, and how many steps had contacts."""
    model.opt.timestep, model.opt.integrator = 5e-4, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.tolerance = 1e-14
    data, rng, contacts = mujoco.MjData(model), np.random.default_rng(0), 0
    for step in range(2000):
        if step % 100 == 0:
            data.ctrl[:num_joints] = rng.uniform(-1, 1, num_joints)
        mujoco.mj_step(model, data)
        contacts += data.ncon > 0
    return data.qpos, contacts


@pytest.mark.parametrize("robot_type", TYPES[:9])
def test_a_padded_arm_moves_as_the_arm_itself(robot_type):
    arm = drawn_arm("reacher", robot_type).compile()
    expected, _ = shake(arm, arm.nu)
    moved, _ = shake(padded(arm, "reacher").models()[0], arm.nu)
    np.testing.assert_allclose(moved[: arm.nq], expected, atol=1e-4)
    np.testing.assert_allclose(moved[arm.nq :], 0.0, atol=1e-4)
    assert np.abs(expected).max() > 0.1


@pytest.mark.parametrize("robot_type", ["A", "D", "H", "J", "K"])
def test_a_padded_arm_moves_as_the_arm_itself_in_contact(robot_type):
    arm = with_table(drawn_arm("peg_insertion", robot_type)).compile()
    expected, contacts = shake(arm, arm.nu)
    moved, _ = shake(padded(arm, "peg_insertion").models()[0], arm.nu)
    assert contacts > 100
    np.testing.assert_allclose(moved[: arm.nq], expected, atol=1e-4)


@pytest.mark.parametrize("robot_type", TYPES)
def test_the_gripper_reaches_from_the_peg_back_to_the_wrist(robot_type):
    arm = arm_spec("peg_insertion", robot_type).compile()
    data = mujoco.MjData(arm)
    mujoco.mj_kinematics(arm, data)
    peg, wrist = data.site("ref_pt"), data.body("l6").xpos
    towards_wrist = peg.xmat.reshape(3, 3).T @ (wrist - peg.xpos)
    np.testing.assert_allclose(towards_wrist, [0.175, 0.0, 0.11], atol=0.012)  # the gripper's capsule lies along x


def test_every_type_lacks_the_joints_that_the_paper_removes():
    for robot_type, removed in REMOVED_JOINTS.items():
        pool = make_arm_pool("peg_insertion", ArmRanges(), [robot_type], 1, seed=0)
        assert pool.hardware["joint_mask"].sum() == 7 - len(removed)
        assert pool.hardware["type"][0, 0] == TYPES.index(robot_type)


def test_a_robot_is_the_same_whatever_pool_it_stands_in():
    large = make_arm_pool("reacher", ArmRanges(), ["A", "C"], 3, seed=1)
    small = make_arm_pool("reacher", ArmRanges(), ["C"], 2, seed=1)
    rows = np.searchsorted(large.robot_id, small.robot_id)
    for name, values in small.hardware.items():
        np.testing.assert_array_equal(large.hardware[name][rows], values)


def test_there_are_no_more_robots_of_a_type_than_ids():
    with pytest.raises(PoolError, match="10,001 arms of each type: expected at most 10,000"):
        make_arm_pool("reacher", ArmRanges(), ("A", "B"), 10_001, seed=0)


def test_ranges_of_zero_width_give_the_nominal_arm():
    exact = {f.name: (1.0, 1.0) if f.name == "mass_ratio" else (0.5, 0.5) for f in dataclasses.fields(ArmRanges)}
    ranges = nominal_lengths(ArmRanges(**exact))
    hardware = {name: values[0] for name, values in sample_hardware(ranges, "I", 1, seed=0).items()}
    arm, nominal = arm_spec("reacher", "I", hardware).compile(), arm_spec("reacher", "I").compile()
    for name in ("body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos", "geom_size", "geom_pos"):
        np.testing.assert_allclose(getattr(arm, name), getattr(nominal, name), atol=1e-12)
    np.testing.assert_allclose(arm.dof_damping, 0.5)


def test_a_link_grows_where_the_paper_says():
    ranges = nominal_lengths(ArmRanges())
    nominal = {name: values[0] for name, values in sample_hardware(ranges, "I", 1, seed=0).items()}
    longer = nominal | {"length_change": nominal["length_change"] + 0.05}
    one, other = (arm_spec("reacher", "I", hardware).compile() for hardware in (nominal, longer))
    grown = np.abs(other.body("l2").pos) - np.abs(one.body("l2").pos)
    np.testing.assert_allclose(grown, [0.0, 0.05, 0.05], atol=1e-12)  # l1_2 along y, l1_1 along z
    np.testing.assert_allclose(other.body("l1").inertia, one.body("l1").inertia)


def test_chains_that_do_not_fit_are_refused():
    spec = arm_spec("reacher", "I")
    body = spec.body("connector_plate_mount")
    body.add_joint(name="eighth", type=mujoco.mjtJoint.mjJNT_HINGE)
    with pytest.raises(ChainError, match="8 hinges"):
        read_chain(spec.compile())
    spec.joint("eighth").type = mujoco.mjtJoint.mjJNT_SLIDE
    with pytest.raises(ChainError, match="'eighth': not a hinge"):
        read_chain(spec.compile())
    with pytest.raises(ChainError, match="'nowhere'"):
        read_chain(arm_spec("reacher", "I").compile(), "nowhere")

import mujoco
import numpy as np
import pytest

from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.rendering.drawing import make_drawing, put_goal


@pytest.mark.parametrize("task", ["reacher", "peg_insertion"])
def test_an_arm_is_drawn_where_the_physics_has_it(task, rng):
    pool = make_arm_pool(task, ArmRanges(), ("A", "H", "I"), 1, seed=3)
    for row, model in enumerate(pool.models()):
        drawing = make_drawing(pool, row)
        angles = rng.uniform(-1.0, 1.0, 7) * pool.hardware["joint_mask"][row]
        poses = []
        for one in (model, drawing):
            data = mujoco.MjData(one)
            data.qpos[:] = angles
            mujoco.mj_kinematics(one, data)
            names = [*(f"slot{i}" for i in range(7)), "tool"]
            poses.append(np.concatenate([np.stack([data.body(name).xpos, data.body(name).xmat[:3]]) for name in names]))
        np.testing.assert_allclose(poses[1], poses[0], atol=1e-9)


def test_links_lead_from_joint_to_joint_and_missing_joints_have_no_shape():
    pool = make_arm_pool("reacher", ArmRanges(), ("A",), 1, seed=3)
    drawing, count = make_drawing(pool, 0), 5
    assert pool.hardware["joint_mask"][0].sum() == count
    for slot in range(7):
        body = drawing.body(f"slot{slot}")
        geoms = [drawing.geom(body.geomadr[0] + i) for i in range(body.geomnum[0])]
        capsules = [geom for geom in geoms if geom.type[0] == mujoco.mjtGeom.mjGEOM_CAPSULE]
        if slot >= count:
            assert not geoms
            continue
        target = pool.hardware["chain_pos"][0, slot + 1]
        (capsule,) = capsules
        np.testing.assert_allclose(capsule.pos, target / 2, atol=1e-9)
        assert capsule.size[1] == pytest.approx(np.linalg.norm(target) / 2)


def test_a_hopper_is_drawn_as_it_was_compiled(pool):
    model, drawing = pool.subset([5]).models()[0], make_drawing(pool, 5)
    for name in ("torso", "thigh", "leg", "foot"):
        np.testing.assert_allclose(drawing.geom(name).size, model.geom(name).size)
        np.testing.assert_allclose(drawing.body(name).pos, model.body(name).pos)


def test_the_goal_takes_the_table_along_and_its_hole_is_above_it():
    pool = make_arm_pool("peg_insertion", ArmRanges(), ("A",), 1, seed=3)
    drawing = make_drawing(pool, 0)
    data, goal = mujoco.MjData(drawing), np.array([0.55, 0.05, -0.02])
    put_goal(drawing, data, goal, reached=True)
    mujoco.mj_kinematics(drawing, data)
    np.testing.assert_allclose(data.body("goal").xpos, goal)
    np.testing.assert_allclose(data.site("target").xpos, goal)

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from hcp_jax.hardware.arm import TYPES
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.kinematics import joint_poses, matrix_to_euler, quat_to_matrix
from hcp_jax.hardware.ranges import ArmRanges


def test_forward_kinematics_equal_mujocos_for_all_types(rng):
    pool = make_arm_pool("peg_insertion", ArmRanges(), TYPES, 2, seed=5)
    angles = rng.uniform(-2, 2, (pool.num_robots, 7)) * pool.hardware["joint_mask"]
    rotation = quat_to_matrix(jnp.asarray(pool.hardware["chain_quat"], jnp.float32))
    positions, rotations = joint_poses(jnp.asarray(pool.hardware["chain_pos"], jnp.float32), rotation, jnp.asarray(angles))
    for row, model in enumerate(pool.models()):
        data = mujoco.MjData(model)
        data.qpos[:] = angles[row]
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(positions[row, -1], data.site("ref_pt").xpos, atol=1e-5)
        np.testing.assert_allclose(rotations[row, -1].reshape(-1), data.site("ref_pt").xmat, atol=1e-5)
        for joint in range(int(pool.hardware["joint_mask"][row].sum())):
            np.testing.assert_allclose(positions[row, joint], data.body(f"slot{joint}").xpos, atol=1e-5)
            np.testing.assert_allclose(rotations[row, joint, :, 2], data.joint(f"slot{joint}").xaxis, atol=1e-5)


def test_euler_angles_give_back_their_rotation(rng):
    quat = rng.normal(size=(200, 4))
    quat[0] = [np.sqrt(0.5), 0, np.sqrt(0.5), 0]  # y at 90 degrees, where x and z are one
    rotation = quat_to_matrix(jnp.asarray(quat / np.linalg.norm(quat, axis=1, keepdims=True)))
    x, y, z = jnp.moveaxis(matrix_to_euler(rotation), -1, 0)

    def turn(axis, angle):
        return quat_to_matrix(jnp.concatenate([jnp.cos(angle / 2)[:, None], jnp.sin(angle / 2)[:, None] * jnp.eye(3)[axis]], 1))

    np.testing.assert_allclose(turn(0, x) @ turn(1, y) @ turn(2, z), rotation, atol=2e-3)


def test_the_end_effector_is_differentiable_in_lengths_and_angles():
    pool = make_arm_pool("reacher", ArmRanges(), ["I"], 1, seed=5)
    pos, quat = (jnp.asarray(pool.hardware[name][0], jnp.float32) for name in ("chain_pos", "chain_quat"))

    def height(pos, angles):
        return joint_poses(pos, quat_to_matrix(quat), angles)[0][-1, 2]

    by_length, by_angle = jax.grad(height, argnums=(0, 1))(pos, jnp.full(7, 0.3))
    assert jnp.abs(by_length).sum() > 0.1
    assert jnp.abs(by_angle).sum() > 0.1

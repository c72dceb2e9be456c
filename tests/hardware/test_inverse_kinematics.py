import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.inverse_kinematics import MAX_TILT, is_reachable, solve_positions
from hcp_jax.hardware.kinematics import joint_poses, quat_to_matrix
from hcp_jax.hardware.ranges import ArmRanges


@pytest.fixture(scope="module")
def arms():
    return make_arm_pool("peg_insertion", ArmRanges(), ["A", "D", "I"], 5, seed=6)


def test_where_an_arm_has_been_it_can_come_again(arms, rng):
    low, high = np.moveaxis(arms.hardware["joint_range"], -1, 0)
    angles = rng.uniform(0.8 * low, 0.8 * high) * arms.hardware["joint_mask"]
    pos, quat = (jnp.asarray(arms.hardware[name], jnp.float32) for name in ("chain_pos", "chain_quat"))
    goal = np.asarray(joint_poses(pos, quat_to_matrix(quat), jnp.asarray(angles))[0][:, -1])
    solution = solve_positions(arms, goal, jax.random.key(0))
    np.testing.assert_allclose(solution.distance, 0.0, atol=5e-3)
    reached = np.asarray(joint_poses(pos, quat_to_matrix(quat), jnp.asarray(solution.angles))[0][:, -1])
    np.testing.assert_allclose(np.linalg.norm(reached - goal, axis=1), solution.distance, atol=1e-5)


def test_nothing_is_reached_3_m_away(arms):
    assert not is_reachable(arms, np.tile([3.0, 0.0, 0.0], (15, 1)), 0.02, jax.random.key(0)).any()


def test_the_hole_is_reached_upright_by_all_types_even_without_the_wrist(arms):
    goal = np.tile([0.6, 0.0, 0.0], (15, 1))
    solution = solve_positions(arms, goal, jax.random.key(0), upright=True)
    assert ((solution.distance < 0.02) & (solution.tilt < MAX_TILT)).mean() > 0.9

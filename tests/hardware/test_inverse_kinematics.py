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


HOLE = np.tile([0.6, 0.0, 0.0], (15, 1))


def tip_positions(arms, angles) -> np.ndarray:
    """[15, 3]"""
    pos, quat = (jnp.asarray(arms.hardware[name], jnp.float32) for name in ("chain_pos", "chain_quat"))
    return np.asarray(joint_poses(pos, quat_to_matrix(quat), jnp.asarray(angles))[0][:, -1])


@pytest.fixture
def been(arms, rng) -> np.ndarray:
    """Where each arm's tip is at angles within its limits: [15, 3]."""
    low, high = np.moveaxis(arms.hardware["joint_range"], -1, 0)
    return tip_positions(arms, rng.uniform(0.8 * low, 0.8 * high) * arms.hardware["joint_mask"])


def test_where_an_arm_has_been_it_can_come_again(arms, been):
    solution = solve_positions(arms, been, jax.random.key(0))
    np.testing.assert_allclose(solution.distance, 0.0, atol=5e-3)
    distance = np.linalg.norm(tip_positions(arms, solution.angles) - been, axis=1)
    np.testing.assert_allclose(distance, solution.distance, atol=1e-5)


def test_where_an_arm_has_been_is_within_reach_and_3_m_away_is_not(arms, been):
    assert is_reachable(arms, been, 0.02, jax.random.key(0)).all()
    assert not is_reachable(arms, np.tile([3.0, 0.0, 0.0], (15, 1)), 0.02, jax.random.key(0)).any()


def test_the_hole_is_reached_upright_by_all_types_even_without_the_wrist(arms):
    solution = solve_positions(arms, HOLE, jax.random.key(0), upright=True)
    assert ((solution.distance < 0.02) & (solution.tilt < MAX_TILT)).mean() > 0.9
    assert is_reachable(arms, HOLE, 0.02, jax.random.key(0), upright=True).mean() > 0.9

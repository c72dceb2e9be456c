import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.hardware.arm import JOINTS, REMOVED_JOINTS
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.joint_slots import JointSlots, aligned_slots
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.ranges import ArmRanges


@pytest.fixture(scope="module")
def arms() -> RobotPool:
    return make_arm_pool("reacher", ArmRanges(), ("A", "H", "I", "R5"), 1, seed=0)


def test_an_aligned_entry_is_the_same_joint_in_every_type(arms):
    numbers = np.zeros((4, 7), np.float32)
    for row, robot_type in enumerate("AHI"):
        present = [joint for joint in JOINTS if joint not in REMOVED_JOINTS[robot_type]]
        numbers[row, : len(present)] = [1.0 + int(joint[1:]) for joint in present]
    entries = JointSlots(arms, "aligned").to_entries(jnp.asarray(numbers), jnp.arange(4))
    np.testing.assert_array_equal(entries[0], [1, 2, 0, 4, 0, 6, 7])  # j2 and j4 removed
    np.testing.assert_array_equal(entries[1], [1, 2, 3, 4, 5, 0, 7])  # j5 removed
    np.testing.assert_array_equal(entries[2], [1, 2, 3, 4, 5, 6, 7])


def test_a_random_chain_is_packed_in_either_layout(arms):
    values = jnp.arange(1.0, 8.0)[None]
    for layout in ("packed", "aligned"):
        np.testing.assert_array_equal(JointSlots(arms, layout).to_entries(values, jnp.array([3])), values)


def test_an_arm_that_no_type_names_is_packed():
    np.testing.assert_array_equal(aligned_slots("own"), np.arange(7))


@pytest.mark.parametrize("layout", ["packed", "aligned"])
@pytest.mark.parametrize("shape", [(7,), (7, 3)])
def test_entries_go_back_to_joints_bit_for_bit(arms, layout, shape, rng):
    slots, index = JointSlots(arms, layout), jnp.array([[3, 1], [0, 2]])
    values = jnp.asarray(rng.normal(size=(2, 2, *shape)), jnp.float32)
    np.testing.assert_array_equal(slots.to_joints(slots.to_entries(values, index), index), values)


def test_an_unknown_layout_is_refused(arms):
    with pytest.raises(ValueError, match="joint_slots='sorted'"):
        JointSlots(arms, "sorted")

"""Where an arm's joints stand among the seven entries of an observation and of an action.

| layout | |
|---|---|
| `packed` | an arm's joints from base to tip, then zeros (paper, section 4.1) |
| `aligned` | joint j of types A to K at entry j, zeros where a type lacks it: an entry is the same joint in every type. Other arms are packed |
"""  # noqa: E501

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.hardware.arm import JOINTS, REMOVED_JOINTS, type_name
from hcp_jax.hardware.kinematics import exact_einsum
from hcp_jax.hardware.pool import RobotPool

LAYOUTS = ("packed", "aligned")


class JointSlots:
    """Brings values of joints, in their order along the arm, to the entries of a layout, and back."""

    def __init__(self, pool: RobotPool, layout: str):
        """Raises ValueError: `layout` is not one of `LAYOUTS`."""
        if layout not in LAYOUTS:
            raise ValueError(f"joint_slots={layout!r}: expected one of {', '.join(LAYOUTS)}")
        self._matrices = None
        if layout == "aligned":
            slots = np.stack([aligned_slots(type_name(number)) for number in pool.hardware["type"][:, 0]])
            self._matrices = jnp.asarray(np.eye(len(JOINTS), dtype=np.float32)[slots])  # [N, 7 joints, 7 entries]

    def to_entries(self, values: jax.Array, index: jax.Array) -> jax.Array:
        """Values of the joints [..., 7] or [..., 7, K] of robots at `index` [...], as entries."""
        return values if self._matrices is None else _reorder(jnp.swapaxes(self._matrices, 1, 2)[index], values)

    def to_joints(self, values: jax.Array, index: jax.Array) -> jax.Array:
        """Entries [..., 7] or [..., 7, K] of robots at `index` [...], as values of the joints."""
        return values if self._matrices is None else _reorder(self._matrices[index], values)


def aligned_slots(robot_type: str) -> np.ndarray:
    """The entry of each joint of a type, base first, and then those that it lacks: a permutation of 0 to 6."""
    removed = REMOVED_JOINTS.get(robot_type, ())
    present = [slot for slot, joint in enumerate(JOINTS) if joint not in removed]
    return np.asarray(present + [slot for slot in range(len(JOINTS)) if slot not in present])


def _reorder(matrices: jax.Array, values: jax.Array) -> jax.Array:
    """Exact: each row has a single 1. (A gather has no translation to ONNX.)"""
    rows = values[..., None] if values.ndim < matrices.ndim else values
    return exact_einsum("...ij,...jk->...ik", matrices, rows).reshape(values.shape)

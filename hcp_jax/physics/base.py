"""The physics interface.

A physics engine advances B worlds, each holding one robot of a pool, under controls held for a number of substeps. Its whole
state is `PhysicsState`; it keeps nothing between calls, so a rollout can be checkpointed, replayed and moved.
"""

from typing import Protocol

import jax
import jax.numpy as jnp
import mujoco
from flax import struct

from hcp_jax.hardware.pool import RobotPool

PHYSICS = ("auto", "mjx-warp", "mjx-jax", "native")
MJ_INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}
INTEGRATORS = tuple(MJ_INTEGRATORS)
# [rad, m, rad/s, m/s] Beyond it a state counts as diverged. MuJoCo says so at 1e10 only; until then the values would ruin the
# statistics by which observations are whitened.
MAX_VALUE = 1e3


@struct.dataclass
class PhysicsState:
    """State of B worlds. qpos: [B, nq]; qvel, qacc_warmstart: [B, nv]; mocap_pos: [B, nmocap, 3], None where a template has no
    mocap body. SI units, float32."""

    qpos: jax.Array
    qvel: jax.Array
    qacc_warmstart: jax.Array
    mocap_pos: jax.Array | None = None


class Physics(Protocol):
    """Steps worlds on one flat leading axis."""

    def step(
        self, robots: RobotPool, state: PhysicsState, ctrl: jax.Array, num_substeps: int
    ) -> tuple[PhysicsState, jax.Array]:
        """Advances every world by `num_substeps` with `ctrl` [B, nu] held.

        Returns:
            The new state, with NaN in the rows whose physics diverged, and the number of worlds whose contact or
            constraint buffer overflowed: [] int32.
        """
        ...


def select_rows(mask: jax.Array, on_true: PhysicsState, on_false: PhysicsState) -> PhysicsState:
    """Rows of `on_true` where `mask` [B] is set, of `on_false` elsewhere."""
    return jax.tree.map(lambda a, b: jnp.where(mask.reshape((-1,) + (1,) * (a.ndim - 1)), a, b), on_true, on_false)


def is_plausible(state: PhysicsState) -> jax.Array:
    """Whether each world's state is usable: [B] bool."""
    rows = jnp.concatenate([state.qpos, state.qvel], axis=-1)
    return jnp.all(jnp.isfinite(rows) & (jnp.abs(rows) < MAX_VALUE), axis=-1)


def chosen_integrator(name: str, integrator: str) -> str:
    """The integrator that an engine's name `native-INTEGRATOR` overrules `integrator` with."""
    return name.removeprefix("native-") if name.startswith("native-") else integrator

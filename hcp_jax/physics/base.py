"""The physics interface and the choice of an engine.

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


def default_physics() -> str:
    """The engine that `auto` stands for on this machine's default JAX backend (DESIGN.md, decision 4)."""
    backend = jax.default_backend()
    if backend == "cpu":
        return "native"
    if backend in ("gpu", "cuda"):
        from hcp_jax.physics import mjx

        return "mjx-warp" if mjx.has_warp() else "mjx-jax"
    return "mjx-jax"


def chosen_integrator(name: str, integrator: str) -> str:
    """The integrator that an engine's name `native-INTEGRATOR` overrules `integrator` with."""
    return name.removeprefix("native-") if name.startswith("native-") else integrator


def make_physics(name: str, pool: RobotPool, sim_dt: float, integrator: str) -> Physics:
    """Builds the engine `name` for the robots of `pool`.

    Args:
        name: one of `PHYSICS`, or `native-INTEGRATOR` to overrule the integrator (`native-rk4`).
        pool: `robots` passed to `step` must be rows of this pool.
        sim_dt: physics time step [s].
        integrator: one of `INTEGRATORS`.

    Raises:
        ValueError: the name or the integrator is unknown.
    """
    if name == "auto":
        name = default_physics()
    integrator = chosen_integrator(name, integrator)
    if integrator not in INTEGRATORS:
        raise ValueError(f"integrator={integrator!r}: expected one of {', '.join(INTEGRATORS)}")
    if name == "native" or name.startswith("native-"):
        from hcp_jax.physics import native

        return native.NativePhysics(pool, sim_dt, integrator)
    if name in ("mjx-warp", "mjx-jax"):
        from hcp_jax.physics import mjx

        return mjx.MjxPhysics(pool, sim_dt, integrator, impl=name.removeprefix("mjx-"))
    raise ValueError(f"physics={name!r}: expected one of {', '.join(PHYSICS)} or native-{{{'|'.join(INTEGRATORS)}}}")

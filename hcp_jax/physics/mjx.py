"""MJX on XLA or Warp, with per-robot model fields on one flat world axis."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
from jax.sharding import PartitionSpec
from mujoco import mjx

from hcp_jax.devices import ROWS, get_mesh, is_divisible
from hcp_jax.errors import UserError
from hcp_jax.hardware.pool import MEAN_INERTIA, RobotPool
from hcp_jax.physics.base import MJ_INTEGRATORS, PhysicsState

# Fields of a pool that MJX does not read: bounding volume trees, lights, and what it cannot batch (STACK.md).
_NOT_IN_MJX = (MEAN_INERTIA, "bvh_aabb", "light_poscom0", "dof_length", "dof_M0")
# Bits of `Data.overflow` that are not a buffer of contacts or constraints (STACK.md).
_HARMLESS_OVERFLOW = 512 | 1024


def has_warp() -> bool:
    """Whether `impl="warp"` can be used in this installation."""
    try:
        import warp  # noqa: F401
    except ImportError:
        return False
    return True


class MjxPhysics:
    """`mjx.step` vmapped over worlds. A nested vmap over worlds gives wrong results with Warp: keep one flat axis."""

    def __init__(
        self,
        pool: RobotPool,
        sim_dt: float,
        integrator: str,
        impl: str,
        max_contacts: int = 8,
        max_constraints: int = 32,
    ):
        """Args:
        pool: the robots that will be stepped.
        sim_dt: physics time step [s].
        integrator: one of `INTEGRATORS`.
        impl: `warp` or `jax`.
        max_contacts, max_constraints: Warp's buffer sizes per world (contacts are shared by all worlds).
        """
        if impl == "warp" and not has_warp():
            raise UserError("physics='mjx-warp': warp-lang is not installed; install mujoco-mjx[warp] or use mjx-jax")
        self._impl = impl
        self._mj_model = pool.template_model()
        self._mj_model.opt.timestep = sim_dt
        self._mj_model.opt.integrator = MJ_INTEGRATORS[integrator]
        # impl="jax" decides from the template which joints can have friction at all.
        self._mj_model.dof_frictionloss[:] = pool.fields["dof_frictionloss"].max(axis=0)
        self._model = mjx.put_model(self._mj_model, impl=impl)
        self._max_contacts = max_contacts
        self._max_constraints = max_constraints

    def step(
        self, robots: RobotPool, state: PhysicsState, ctrl: jax.Array, num_substeps: int
    ) -> tuple[PhysicsState, jax.Array]:
        step_rows = functools.partial(self._step_rows, num_substeps=num_substeps)
        if not is_divisible(ctrl.shape[0]):
            return step_rows(robots, state, ctrl)

        def step_own_rows(robots: RobotPool, state: PhysicsState, ctrl: jax.Array) -> tuple[PhysicsState, jax.Array]:
            state, overflow = step_rows(robots, state, ctrl)
            return state, jax.lax.psum(overflow, ROWS[0])

        specs = {"in_specs": ROWS, "out_specs": (ROWS, PartitionSpec())}
        return jax.shard_map(step_own_rows, mesh=get_mesh(), check_vma=False, **specs)(robots, state, ctrl)

    def _step_rows(
        self, robots: RobotPool, state: PhysicsState, ctrl: jax.Array, num_substeps: int
    ) -> tuple[PhysicsState, jax.Array]:
        num_worlds = ctrl.shape[0]
        fields: dict[str, Any] = {
            name: values.reshape(num_worlds, *getattr(self._model, name).shape)  # Warp splits boxes into two corners
            for name, values in robots.fields.items()
            if name not in _NOT_IN_MJX
        }
        model = self._model.tree_replace(fields)
        axes = jax.tree.map(lambda _: None, self._model).tree_replace(dict.fromkeys(fields, 0))
        step_world = functools.partial(self._step_world, num_worlds=num_worlds, num_substeps=num_substeps)
        state, overflow = jax.vmap(step_world, in_axes=(axes, 0, 0))(model, state, ctrl)
        return state, jnp.sum((overflow & ~_HARMLESS_OVERFLOW) != 0, dtype=jnp.int32)

    def _step_world(self, model, state: PhysicsState, ctrl, *, num_worlds: int, num_substeps: int):
        data = self._make_data(num_worlds)
        data = data.replace(qpos=state.qpos, qvel=state.qvel, qacc_warmstart=state.qacc_warmstart, ctrl=ctrl)
        if state.mocap_pos is not None:
            data = data.replace(mocap_pos=state.mocap_pos)

        def substep(carry, _):
            data, overflow = carry
            data = mjx.step(model, data)
            return (data, overflow | self._overflow(data)), None

        (data, overflow), _ = jax.lax.scan(substep, (data, jnp.int32(0)), None, length=num_substeps)
        return state.replace(qpos=data.qpos, qvel=data.qvel, qacc_warmstart=data.qacc_warmstart), overflow

    def _make_data(self, num_worlds: int) -> mjx.Data:
        if self._impl != "warp":
            return mjx.make_data(self._mj_model, impl=self._impl)
        return mjx.make_data(self._mj_model, impl="warp", naconmax=self._max_contacts * num_worlds, njmax=self._max_constraints)

    def _overflow(self, data: mjx.Data) -> jax.Array:
        # impl="jax" allocates every possible contact and constraint, so it has nothing to overflow.
        return jnp.int32(data._impl.overflow) if self._impl == "warp" else jnp.int32(0)

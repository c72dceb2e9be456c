"""Native MuJoCo on all CPU cores, called from inside jitted code."""

import os
import threading

import jax
import mujoco
import mujoco.batch
import numpy as np

from hcp_jax.hardware.pool import RobotPool
from hcp_jax.physics.base import PhysicsState

_WARNING = mujoco.mjtWarning
_DIVERGED = [int(_WARNING.mjWARN_BADQPOS), int(_WARNING.mjWARN_BADQVEL), int(_WARNING.mjWARN_BADQACC)]
_OVERFLOWED = [int(_WARNING.mjWARN_CONTACTFULL), int(_WARNING.mjWARN_CNSTRFULL)]
_COUNT = 1  # of the two numbers per warning: last info, count
MJ_INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}


class NativePhysics:
    """`mujoco.batch` behind `jax.pure_callback`: each world runs its robot's own MjModel, in float64 inside a step.

    The callback gets and returns the whole state, so it may be elided or repeated. Results do not depend on the
    number of threads.
    """

    def __init__(self, pool: RobotPool, sim_dt: float, integrator: str):
        self._models = pool.models()
        for model in self._models:
            model.opt.timestep = sim_dt
            model.opt.integrator = MJ_INTEGRATORS[integrator]
        self._row_order = np.argsort(pool.robot_id)
        self._sorted_ids = np.asarray(pool.robot_id)[self._row_order]
        if np.any(np.diff(self._sorted_ids) == 0):
            raise ValueError("a pool with two robots of one id cannot be simulated")
        self._worlds: dict[int, _Worlds] = {}
        self._lock = threading.Lock()

    def step(
        self, robots: RobotPool, state: PhysicsState, ctrl: jax.Array, num_substeps: int
    ) -> tuple[PhysicsState, jax.Array]:
        shapes = (
            *(jax.ShapeDtypeStruct(leaf.shape, np.float32) for leaf in (state.qpos, state.qvel, state.qacc_warmstart)),
            jax.ShapeDtypeStruct((), np.int32),
        )

        def host_step(robot_id, state, ctrl):
            with self._lock:
                return self._host_step(num_substeps, *jax.tree.map(np.asarray, (robot_id, state, ctrl)))

        qpos, qvel, warmstart, overflow = jax.pure_callback(host_step, shapes, robots.robot_id, state, ctrl)
        return state.replace(qpos=qpos, qvel=qvel, qacc_warmstart=warmstart), overflow

    def _host_step(self, num_substeps, robot_id, state, ctrl):
        num_worlds = len(robot_id)
        if num_worlds not in self._worlds:
            self._worlds[num_worlds] = _Worlds(self._models[0], num_worlds)
        worlds = self._worlds[num_worlds]
        rows = self._row_order[np.searchsorted(self._sorted_ids, robot_id)]
        return worlds.step(self._models, rows, state, ctrl, num_substeps)


class _Worlds:
    """B simulations on a thread pool; remembers which robots stand in them."""

    def __init__(self, model: mujoco.MjModel, num_worlds: int):
        self._batch = mujoco.batch.Batch(model, num_worlds, len(os.sched_getaffinity(0)))
        self._rows = np.full(num_worlds, -1)

    def step(self, models, rows, state, ctrl, num_substeps):
        batch = self._batch
        if not np.array_equal(rows, self._rows):
            batch.set_models([models[row] for row in rows])
            self._rows = rows.copy()
        batch.qpos[:], batch.qvel[:], batch.qacc_warmstart[:], batch.ctrl[:] = (
            state.qpos,
            state.qvel,
            state.qacc_warmstart,
            ctrl,
        )
        if state.mocap_pos is not None:
            batch.mocap_pos[:] = state.mocap_pos
        batch.time[:] = 0
        batch.warning[:] = 0
        batch.step(nstep=num_substeps)
        qpos, qvel, warmstart = (np.asarray(a, np.float32) for a in (batch.qpos, batch.qvel, batch.qacc_warmstart))
        diverged = batch.warning[:, _DIVERGED, _COUNT].any(axis=1)
        if diverged.any():
            qpos[diverged] = qvel[diverged] = warmstart[diverged] = np.nan
        overflow = np.int32(batch.warning[:, _OVERFLOWED, _COUNT].any(axis=1).sum())
        return qpos, qvel, warmstart, overflow

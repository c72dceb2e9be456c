"""Native MuJoCo on all CPU cores, called from inside jitted code."""

import threading

import jax
import jax.numpy as jnp
import mujoco
import mujoco.batch
import numpy as np

from hcp_jax.devices import ROWS, count_cores, get_mesh
from hcp_jax.hardware.pool import MEAN_INERTIA, PoolError, RobotPool
from hcp_jax.physics.base import MJ_INTEGRATORS, PhysicsState

_WARNING = mujoco.mjtWarning
_DIVERGED = [int(_WARNING.mjWARN_BADQPOS), int(_WARNING.mjWARN_BADQVEL), int(_WARNING.mjWARN_BADQACC)]
_OVERFLOWED = [int(_WARNING.mjWARN_CONTACTFULL), int(_WARNING.mjWARN_CNSTRFULL)]
_COUNT = 1  # of the two numbers per warning: last info, count
# Counts start here, since MuJoCo prints a warning that it counts as the first (on a terminal and into MUJOCO_LOG.TXT). A
# world that diverged is reset by MuJoCo, its counts too, and counts one warning then.
_COUNTED_BEFORE = 2


class NativePhysics:
    """`mujoco.batch` behind `jax.pure_callback`: each world has its robot's own model fields, in float64 inside a step.

    The callback gets and returns the whole state, so it may be elided or repeated. Each device calls it for its own worlds, on
    its share of the cores. Results do not depend on the number of threads.
    """

    def __init__(self, pool: RobotPool, sim_dt: float, integrator: str):
        self._model = pool.template_model()
        self._model.opt.timestep = sim_dt
        self._model.opt.integrator = MJ_INTEGRATORS[integrator]
        self._fields = get_batch_fields(pool, self._model)
        self._row_order = np.argsort(pool.robot_id)
        self._sorted_ids = np.asarray(pool.robot_id)[self._row_order]
        if np.any(np.diff(self._sorted_ids) == 0):
            raise PoolError("a pool with two robots of one id cannot be simulated")
        self._worlds: dict[tuple[int, int], _Worlds] = {}  # by device and number
        self._lock = threading.Lock()

    def step(
        self, robots: RobotPool, state: PhysicsState, ctrl: jax.Array, num_substeps: int
    ) -> tuple[PhysicsState, jax.Array]:
        def step_own_worlds(robot_id: jax.Array, state: PhysicsState, ctrl: jax.Array):
            return self._step_on_device(robot_id, state, ctrl, num_substeps)

        num_worlds, mesh = ctrl.shape[0], get_mesh()
        arguments: tuple = (robots.robot_id, state, ctrl)
        num_padded = -(-num_worlds // mesh.size) * mesh.size
        if num_padded != num_worlds:  # the first ones again, so that every device has as many
            arguments = jax.tree.map(lambda leaf: leaf[jnp.arange(num_padded) % num_worlds], arguments)
        step = jax.shard_map(step_own_worlds, mesh=mesh, in_specs=ROWS, out_specs=ROWS, check_vma=False)
        state, overflowed = jax.tree.map(lambda leaf: leaf[:num_worlds], step(*arguments))
        return state, jnp.sum(overflowed, dtype=jnp.int32)

    def _step_on_device(self, robot_id: jax.Array, state: PhysicsState, ctrl: jax.Array, num_substeps: int):
        shapes = (
            *(jax.ShapeDtypeStruct(leaf.shape, np.float32) for leaf in (state.qpos, state.qvel, state.qacc_warmstart)),
            jax.ShapeDtypeStruct(robot_id.shape, bool),
        )

        def host_step(device, robot_id, state, ctrl):
            robot_id, state, ctrl = jax.tree.map(np.asarray, (robot_id, state, ctrl))
            return self._host_step(num_substeps, robot_id, state, ctrl, int(device))

        device = jax.lax.axis_index(ROWS[0])
        qpos, qvel, warmstart, overflowed = jax.pure_callback(host_step, shapes, device, robot_id, state, ctrl)
        return state.replace(qpos=qpos, qvel=qvel, qacc_warmstart=warmstart), overflowed

    def _host_step(self, num_substeps, robot_id, state, ctrl, device=0):
        with self._lock:
            key = (device, len(robot_id))
            if key not in self._worlds:
                self._worlds[key] = _Worlds(self._model, len(robot_id))
        rows = self._row_order[np.searchsorted(self._sorted_ids, robot_id)]
        return self._worlds[key].step(self._fields, rows, state, ctrl, num_substeps)


def get_batch_fields(pool: RobotPool, model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """What a pool's robots have in place of the fields of `model`, for `mujoco.batch.Batch.expand`: [N, ...] by name.

    A batch has one `stat.meaninertia` for all. Only the solver reads it, as a factor of its tolerance: so the tolerance has it.
    """
    fields = {name: np.asarray(values) for name, values in pool.fields.items() if name != MEAN_INERTIA}
    varied = {name: values for name, values in fields.items() if np.any(values != getattr(model, name))}
    inertia = np.asarray(pool.fields[MEAN_INERTIA]) / model.stat.meaninertia
    return varied | {"opt.tolerance": model.opt.tolerance * inertia}


class _Worlds:
    """B simulations on a thread pool; remembers which robots stand in them."""

    def __init__(self, model: mujoco.MjModel, num_worlds: int):
        num_threads = max(1, count_cores() // jax.local_device_count())
        self._batch = mujoco.batch.Batch(model, num_worlds, num_threads)
        self._rows = np.full(num_worlds, -1)
        self._lock = threading.Lock()

    def step(self, fields, rows, state, ctrl, num_substeps):
        with self._lock:
            self._place_robots(fields, rows)
            return self._step(state, ctrl, num_substeps)

    def _place_robots(self, fields, rows):
        changed = np.flatnonzero(rows != self._rows)
        if changed.size:
            for name, values in fields.items():
                self._batch.expand(name)[changed] = values[rows[changed]]
            self._rows = rows

    def _step(self, state, ctrl, num_substeps):
        batch = self._batch
        batch.qpos[:], batch.qvel[:], batch.qacc_warmstart[:], batch.ctrl[:] = (
            state.qpos,
            state.qvel,
            state.qacc_warmstart,
            ctrl,
        )
        if state.mocap_pos is not None:
            batch.mocap_pos[:] = state.mocap_pos
        batch.time[:] = 0
        batch.warning[:] = _COUNTED_BEFORE
        batch.step(nstep=num_substeps)
        qpos, qvel, warmstart = (np.asarray(a, np.float32) for a in (batch.qpos, batch.qvel, batch.qacc_warmstart))
        diverged = (batch.warning[:, _DIVERGED, _COUNT] != _COUNTED_BEFORE).any(axis=1)
        if diverged.any():
            qpos[diverged] = qvel[diverged] = warmstart[diverged] = np.nan
        return qpos, qvel, warmstart, (batch.warning[:, _OVERFLOWED, _COUNT] > _COUNTED_BEFORE).any(axis=1)

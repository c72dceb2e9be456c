"""An engine for a pool, by its name. Only the one that is asked for is imported: MJX takes seconds."""

import jax

from hcp_jax.hardware.pool import RobotPool
from hcp_jax.physics.base import INTEGRATORS, PHYSICS, Physics, chosen_integrator


def resolve_physics(name: str) -> str:
    """The engine that a name stands for: itself, but for `auto`."""
    return default_physics() if name == "auto" else name


def default_physics() -> str:
    """The engine that `auto` stands for on this machine's default JAX backend."""
    backend = jax.default_backend()
    if backend == "cpu":
        return "native"
    if backend in ("gpu", "cuda"):
        from hcp_jax.physics import mjx

        return "mjx-warp" if mjx.has_warp() else "mjx-jax"
    return "mjx-jax"


def make_physics(name: str, pool: RobotPool, sim_dt: float, integrator: str) -> Physics:
    """Builds the engine `name` for the robots of `pool`.

    Args:
        name: one of `PHYSICS`, or `native-INTEGRATOR` to overrule the integrator (`native-rk4`).
        pool: `robots` passed to `step` must be rows of this pool.
        sim_dt: physics time step [s].
        integrator: one of `INTEGRATORS`.

    Raises:
        ValueError: the name or the integrator is unknown.
        UserError: Warp is not installed.
        PoolError: two robots of the pool have one id.
    """
    name = resolve_physics(name)
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

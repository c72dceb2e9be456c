"""Updates with a loss or gradient that is not finite are skipped, and the robots behind them remembered."""

from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct


@struct.dataclass
class Skipped:
    """What was skipped. total: [] int32 updates; in_a_row: [] int32 the newest ones; longest: [] int32 most in a row so far;
    robots: [N] int32 skipped updates whose batch held each robot."""

    total: jax.Array
    in_a_row: jax.Array
    longest: jax.Array
    robots: jax.Array


def init_skipped(num_robots: int) -> Skipped:
    return Skipped(jnp.int32(0), jnp.int32(0), jnp.int32(0), jnp.zeros(num_robots, jnp.int32))


def apply_update(
    optimizer: optax.GradientTransformation,
    grads: Any,
    metrics: dict[str, jax.Array],
    params: Any,
    opt_state: Any,
    skipped: Skipped,
    index: jax.Array,
) -> tuple[Any, Any, dict[str, jax.Array], Skipped]:
    """One step of the optimizer, unless a gradient or a metric of its loss is not finite: then everything stays as it was.

    Args:
        optimizer: of `params`.
        grads: of `params`.
        metrics: scalars that follow from the loss.
        params, opt_state: before the update.
        skipped: so far.
        index: [B] int32, the robots in the batch.

    Returns:
        params, opt_state, metrics (0 where the update is skipped) and skipped.
    """
    leaves = [*jax.tree.leaves(grads), *metrics.values()]
    is_finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in leaves]))
    updates, new_opt_state = optimizer.update(grads, opt_state, params)
    new_params = optax.apply_updates(params, updates)

    def choose(new, old):
        return jax.tree.map(lambda a, b: jnp.where(is_finite, a, b), new, old)

    in_a_row = jnp.where(is_finite, 0, skipped.in_a_row + 1)
    present = jnp.zeros_like(skipped.robots).at[index].set(jnp.where(is_finite, 0, 1))
    skipped = Skipped(
        total=skipped.total + ~is_finite,
        in_a_row=in_a_row,
        longest=jnp.maximum(skipped.longest, in_a_row),
        robots=skipped.robots + present,
    )
    metrics = {name: jnp.where(is_finite, value, 0.0) for name, value in metrics.items()}
    return choose(new_params, params), choose(new_opt_state, opt_state), metrics, skipped

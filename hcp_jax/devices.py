"""All local devices as one: worlds and batches are split over them, networks and replay buffers are on each of them."""

import functools
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

ROWS = PartitionSpec("rows")


@functools.cache
def get_mesh() -> Mesh:
    """All devices of the default backend on one axis, `rows`."""
    return Mesh(np.asarray(jax.devices()), ("rows",))


def is_divisible(num_rows: int) -> bool:
    """Whether every device gets as many of `num_rows`."""
    return num_rows % get_mesh().size == 0


def split_rows(tree: Any) -> Any:
    """Inside jitted code: splits the leading axis of every array over the devices.

    Scalars, and arrays whose rows do not divide evenly, are on every device.
    """
    mesh = get_mesh()

    def split(leaf: jax.Array) -> jax.Array:
        spec = ROWS if leaf.ndim and is_divisible(leaf.shape[0]) else PartitionSpec()
        return jax.lax.with_sharding_constraint(leaf, NamedSharding(mesh, spec))

    return jax.tree.map(split, tree)


def replicate(tree: Any) -> Any:
    """Puts every array on every device."""
    return jax.device_put(tree, NamedSharding(get_mesh(), PartitionSpec()))

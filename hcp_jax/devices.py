"""All devices of all processes as one: worlds and batches are split over them, networks and replay buffers are on each of them.

Every process runs the same program on the same values; process 0 alone writes and speaks.
"""

import functools
import os
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from hcp_jax.errors import UserError

ROWS = PartitionSpec("rows")
EVERYWHERE = PartitionSpec()
# As JAX reads the first of them; where the others are not set, it asks the cluster (Slurm, Open MPI, Kubernetes, TPU pods).
COORDINATOR, NUM_PROCESSES, PROCESS_ID = "JAX_COORDINATOR_ADDRESS", "JAX_NUM_PROCESSES", "JAX_PROCESS_ID"
# Rows of a matrix product up to which a CPU is faster with one thread: handing out the parts takes longer than multiplying. Of
# DDPG's updates, one thread took 21 % less than two with 128 rows and 14 % more with 1,024;
# between them nothing was measured.
SMALL_BATCH = 256


class JoinError(UserError):
    """The processes that are to train together are not known or not reached."""


def join_processes() -> None:
    """Makes this process one of several that train together. Must come before any computation.

    Raises:
        JoinError: neither the environment nor a cluster says who they are, or process 0 is not reached.
    """
    given = {name: os.environ.get(name) for name in (NUM_PROCESSES, PROCESS_ID)}
    for name, value in given.items():
        if value is not None and not value.isdecimal():
            raise JoinError(f"{name}={value}: expected a whole number")
    num_processes, process_id = (None if value is None else int(value) for value in given.values())
    try:
        jax.distributed.initialize(num_processes=num_processes, process_id=process_id)
    except (ValueError, RuntimeError) as error:
        raise JoinError(
            f"--distributed: {error} (set {COORDINATOR}=HOST:PORT of process 0, {NUM_PROCESSES} and {PROCESS_ID}, or start it "
            "under Slurm, Open MPI or Kubernetes)"
        ) from error


def count_cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def options_for_batch(batch_size: int) -> dict[str, bool] | None:
    """Compiler options of jitted updates from batches of this size."""
    if jax.default_backend() == "cpu" and batch_size <= SMALL_BATCH:
        return {"xla_cpu_multi_thread_eigen": False}
    return None


def is_main() -> bool:
    """Whether this is process 0."""
    return jax.process_index() == 0


def any_process(flag: bool) -> bool:
    """Whether `flag` is set in any process. Every process must call it, and waits for the others."""
    return flag if jax.process_count() == 1 else bool(multihost_utils.process_allgather(np.asarray(flag)).any())


def from_main(number: int) -> int:
    """`number` as process 0 has it. Every process must call it, and waits for process 0."""
    return number if jax.process_count() == 1 else int(multihost_utils.broadcast_one_to_all(np.asarray(number)))


def do_in_main(action: Callable[[], None]) -> None:
    """Runs `action` in process 0 alone, while the others wait. Where it raises an exception, they raise a JoinError."""
    error = None
    if is_main():
        try:
            action()
        except Exception as raised:  # whatever it is, the others must not wait for ever
            error = raised
    if any_process(error is not None):
        raise error or JoinError("process 0 could not go on, and says why")


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
        spec = ROWS if leaf.ndim and is_divisible(leaf.shape[0]) else EVERYWHERE
        return jax.lax.with_sharding_constraint(leaf, NamedSharding(mesh, spec))

    return jax.tree.map(split, tree)


def put_everywhere(tree: Any) -> Any:
    """Inside jitted code: every array on every device."""
    return jax.lax.with_sharding_constraint(tree, NamedSharding(get_mesh(), EVERYWHERE))


def replicate(tree: Any) -> Any:
    """Puts every array, which all processes have, on every device."""

    def put(leaf: Any) -> jax.Array:
        if isinstance(leaf, jax.Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            # As numbers, which processes can compare.
            return jax.random.wrap_key_data(put(jax.random.key_data(leaf)), impl=jax.random.key_impl(leaf))
        return jax.device_put(leaf, NamedSharding(get_mesh(), EVERYWHERE))

    return jax.tree.map(put, tree)


def shapes_of(make: Callable[[], Any]) -> Any:
    """Shapes and types of the arrays that `make` would give, each on every device, without computing them."""
    sharding = NamedSharding(get_mesh(), EVERYWHERE)
    return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype, sharding=sharding), jax.eval_shape(make))


def gather(tree: Any) -> Any:
    """Arrays that may be split over processes, whole and on a device of this one. Every process must call it."""
    if jax.process_count() == 1:
        return tree
    return jax.tree.map(lambda leaf: leaf.addressable_data(0), jax.jit(put_everywhere)(tree))


def copy_tree(tree: Any) -> Any:
    """Fresh buffers, so that donating them leaves the original alone."""
    return jax.tree.map(jnp.copy, tree)

"""Runs of a sweep on a Ray cluster. Needs the extra `ray`, and on each of several machines this package and the run folders."""

import pathlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from hcp_jax.config import Config, to_dict
from hcp_jax.errors import UserError, one_line

MAX_RETRIES = 3

Job = tuple[Config, pathlib.Path]
# (config as a dict, folder) -> None; trains, resumes or skips.
Run = Callable[[dict[str, Any], str], None]


def run_on_ray(jobs: Sequence[Job], run: Run, address: str, cpus_per_run: int) -> Iterator[tuple[Job, str | None]]:
    """Runs all jobs, as many at a time as the cluster has room for. A run whose worker dies is resumed elsewhere.

    Args:
        jobs: configs with their run folders.
        run: what a worker does with one of them.
        address: of the cluster, or `local` for one of this machine's cores.
        cpus_per_run: cores that each run reserves.

    Yields:
        each job that ended, with what it failed with after `MAX_RETRIES` more tries, or None.

    Raises:
        UserError: Ray is not installed.
    """
    try:
        import ray
    except ImportError as error:
        raise UserError("--ray: needs the extra ray: pip install ray") from error
    ray.init(address=address, include_dashboard=False, log_to_driver=True)
    try:
        # Only a worker's death is tried again: bad input stays bad.
        remote = ray.remote(num_cpus=cpus_per_run, max_retries=MAX_RETRIES)(run)
        waiting = {remote.remote(to_dict(config), str(folder.resolve())): (config, folder) for config, folder in jobs}
        while waiting:
            (done,), _ = ray.wait(list(waiting), num_returns=1)
            job = waiting.pop(done)
            try:
                ray.get(done)
                yield job, None
            except ray.exceptions.RayTaskError as error:
                yield job, one_line(error.cause)
            except ray.exceptions.RayError as error:
                yield job, one_line(error)
    finally:
        ray.shutdown()

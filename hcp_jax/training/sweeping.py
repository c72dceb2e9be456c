"""Several runs one after the other, or on a Ray cluster: what is done is skipped, what was cut off goes on."""

import pathlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from hcp_jax.config import Config, ConfigError, to_dict
from hcp_jax.errors import BREAKING_ERRORS, UserError, one_line
from hcp_jax.training import loop, run_folder
from hcp_jax.training.checkpoint import latest_iteration
from hcp_jax.training.curves import CURVES_FILE

MAX_RETRIES = 3

Job = tuple[Config, pathlib.Path]
# (config as a dict, folder) -> None; trains, resumes or skips.
Worker = Callable[[dict[str, Any], str], None]


def check_jobs(jobs: Sequence[Job]) -> None:
    """Raises ConfigError or RunFolderError where two runs would share a folder, or a folder holds a run of other settings."""
    folders = [folder for _, folder in jobs]
    for config, folder in jobs:
        if folders.count(folder) > 1:
            raise ConfigError(f"name={config.name!r}: two experiments of the list have this name, and would share {folder}")
        if (folder / run_folder.CONFIG_FILE).exists():
            run_folder.check_resumable(folder, config)


def run_experiment(config: Config, folder: pathlib.Path, interrupt: loop.Interrupt | None = None) -> bool:
    """Trains, resumes or skips one experiment. Returns whether it was interrupted before its end."""
    if not is_done(config, folder):
        loop.train(config, folder, (folder / run_folder.CONFIG_FILE).exists(), interrupt)
    return not is_done(config, folder)


def is_done(config: Config, folder: pathlib.Path) -> bool:
    """Whether a run has all its steps and what it writes last."""
    iterations = latest_iteration(folder / run_folder.CHECKPOINT_FOLDER)
    return iterations == config.num_iterations and (folder / CURVES_FILE).exists()


def run_here(jobs: Sequence[Job]) -> Iterator[tuple[Job, str | None]]:
    """Runs one after the other; one that fails does not keep the others from running. Stops where the user interrupts.

    Yields:
        each job that ended, with what it failed with, or None.
    """
    with loop.Interrupt().installed() as interrupt:
        for job in jobs:
            try:
                if not run_experiment(*job, interrupt):
                    yield job, None
            except (UserError, *BREAKING_ERRORS) as error:
                yield job, one_line(error)
            if interrupt.requested:
                return


def run_on_ray(jobs: Sequence[Job], worker: Worker, address: str, cpus_per_run: int) -> Iterator[tuple[Job, str | None]]:
    """Runs all jobs, as many at a time as the cluster has room for. A run whose worker dies is resumed elsewhere.

    Each machine needs this package, the extra `ray`, and the run folders.

    Args:
        jobs: configs with their run folders.
        worker: what a worker does with one of them.
        address: of the cluster, or `local` for one of this machine's cores.
        cpus_per_run: cores that each run reserves.

    Yields:
        each job that ended, with what it failed with after `MAX_RETRIES` more tries, or None.

    Raises:
        UserError: Ray is not installed.
    """
    try:
        import ray  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise UserError("--ray: needs the extra ray: pip install ray") from error
    ray.init(address=address, include_dashboard=False, log_to_driver=True)
    try:
        # Only a worker's death is tried again: bad input stays bad.
        remote = ray.remote(num_cpus=cpus_per_run, max_retries=MAX_RETRIES)(worker)
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

"""`python -m hcp_jax.sweep experiments/LIST.py --seeds 3 [--out runs/LIST] [--ray ADDRESS] [--config.FIELD=VALUE ...]`"""

import dataclasses
import functools
import pathlib
import sys

from hcp_jax import command_line
from hcp_jax.config import Config, ConfigError, from_dict
from hcp_jax.errors import NonFiniteError, PhysicsOverflowError, one_line
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.summary import summarise_runs
from hcp_jax.ray_sweep import Job, run_on_ray
from hcp_jax.training import loop, run_folder
from hcp_jax.training.checkpoint import latest_iteration


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.sweep",
        description="Runs a list of experiments with several seeds: skips what is done, resumes what was cut off.",
    )
    parser.add_argument("list", help="Python file whose get_configs() gives the experiments; it will be executed")
    parser.add_argument("--seeds", type=int, default=1, help="seeds 0 to SEEDS-1 of each experiment (default: 1)")
    parser.add_argument("--out", type=command_line.output_folder, help="folder of run folders (default: runs/LIST)")
    parser.add_argument(
        "--summary", type=command_line.output_file(".json"), help="JSON file for the table (default: OUT/summary.json)"
    )
    parser.add_argument("--ray", metavar="ADDRESS", help="run on this Ray cluster; `local`: on one of this machine's cores")
    parser.add_argument("--cpus-per-run", type=int, help="with --ray: cores that each run reserves (default: 1)")
    known, overrides = parser.parse_known_args(arguments)
    with command_line.user_errors_end_the_command():
        if known.seeds < 1:
            raise ConfigError(f"--seeds={known.seeds}: expected at least 1")
        if known.cpus_per_run is not None and known.ray is None:
            raise ConfigError("--cpus-per-run: goes with --ray")
        cpus = 1 if known.cpus_per_run is None else known.cpus_per_run
        if cpus < 1:
            raise ConfigError(f"--cpus-per-run={cpus}: expected at least 1")
        if any(word.startswith("--config.seed") for word in overrides):
            raise ConfigError("--config.seed: a sweep has seeds 0 to SEEDS-1; expected --seeds")
        configs = [command_line.apply_overrides(config, overrides) for config in command_line.load_configs(known.list)]
        command_line.enable_compilation_cache()
        out = known.out or pathlib.Path("runs") / pathlib.Path(known.list).stem
        jobs = [
            (dataclasses.replace(config, seed=seed), out / f"{config.name}_s{seed}")
            for seed in range(known.seeds)
            for config in configs
        ]
        check_jobs(jobs)
        run_all = run_here if known.ray is None else functools.partial(run_there, address=known.ray, cpus=cpus)
        if run_all(jobs):
            write_json(known.summary or out / "summary.json", summarise_runs([folder for _, folder in jobs]))


def check_jobs(jobs: list[Job]) -> None:
    """Raises ConfigError or RunFolderError where two runs would share a folder, or a folder holds a run of other settings."""
    folders = [folder for _, folder in jobs]
    for config, folder in jobs:
        if folders.count(folder) > 1:
            raise ConfigError(f"name={config.name!r}: two experiments of the list have this name, and would share {folder}")
        if (folder / run_folder.CONFIG_FILE).exists():
            run_folder.check_resumable(folder, config)


def run_here(jobs: list[Job]) -> bool:
    """Runs one after the other. Returns whether all are done; False if the user interrupted one. Ends the command as
    `run_there` does."""
    failed = []
    with loop.Interrupt().installed() as interrupt:
        for config, folder in jobs:
            try:
                run_experiment(config, folder, interrupt)
            except (PhysicsOverflowError, NonFiniteError) as error:
                print(f"{folder}: {one_line(error)}", flush=True)
                failed.append(folder)
            if interrupt.requested:
                return False
    end_if_failed(failed, jobs)
    return True


def run_there(jobs: list[Job], address: str, cpus: int) -> bool:
    """Runs on a Ray cluster. Ends the command with exit code 1 where some runs failed, after the others are done."""
    failed = []
    for (_, folder), error in run_on_ray(jobs, run_in_worker, address, cpus):
        print(f"{folder}: {error or 'done'}", flush=True)
        failed += [folder] if error else []
    end_if_failed(failed, jobs)
    return True


def end_if_failed(failed: list[pathlib.Path], jobs: list[Job]) -> None:
    """Ends the command with exit code 1 if there are failed runs."""
    if failed:
        print(f"{len(failed)} of {len(jobs)} runs failed: {', '.join(map(str, failed))}", file=sys.stderr)
        sys.exit(command_line.BROKEN)


def run_in_worker(config: dict, folder: str) -> None:
    """Raises RuntimeError if the run was interrupted: it is not done."""
    command_line.enable_compilation_cache()
    if run_experiment(from_dict(Config, config), pathlib.Path(folder)):
        raise RuntimeError("interrupted; saved")


def run_experiment(config: Config, folder: pathlib.Path, interrupt: loop.Interrupt | None = None) -> bool:
    """Trains, resumes or skips one experiment. Returns whether it was interrupted before its end."""
    resume = (folder / run_folder.CONFIG_FILE).exists()
    if resume:
        iterations = latest_iteration(folder / run_folder.CHECKPOINT_FOLDER) or 0
        if iterations * config.batch_size >= config.total_env_steps:
            print(f"{folder}: done", flush=True)
            return False
    return loop.train(config, folder, resume, interrupt) is None


if __name__ == "__main__":
    main()

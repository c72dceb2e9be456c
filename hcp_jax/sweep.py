"""`python -m hcp_jax.sweep experiments/LIST.py --seeds 3 [--out runs/LIST] [--ray ADDRESS] [--config.FIELD=VALUE ...]`"""

import dataclasses
import pathlib
import sys

from hcp_jax import command_line
from hcp_jax.config import Config, ConfigError, from_dict
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.summary import summarise_runs
from hcp_jax.training import sweeping


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
        sweeping.check_jobs(jobs)
        runs = sweeping.run_here(jobs) if known.ray is None else sweeping.run_on_ray(jobs, run_in_worker, known.ray, cpus)
        ended = []
        for (_, folder), error in runs:
            print(f"{folder}: {error or 'done'}", flush=True)
            ended.append((folder, error))
        failed = [str(folder) for folder, error in ended if error]
        if failed:
            print(f"{len(failed)} of {len(jobs)} runs failed: {', '.join(failed)}", file=sys.stderr)
            sys.exit(command_line.BROKEN)
        if len(ended) == len(jobs):
            write_json(known.summary or out / "summary.json", summarise_runs([folder for _, folder in jobs]))


def run_in_worker(config: dict, folder: str) -> None:
    """Raises RuntimeError if the run was interrupted: it is not done."""
    command_line.enable_compilation_cache()
    if sweeping.run_experiment(from_dict(Config, config), pathlib.Path(folder)):
        raise RuntimeError("interrupted; saved")


if __name__ == "__main__":
    main()

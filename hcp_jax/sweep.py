"""`python -m hcp_jax.sweep experiments/LIST.py --seeds 3 [--out runs/LIST] [--summary FILE] [--config.FIELD=VALUE ...]`"""

import argparse
import dataclasses
import pathlib

from hcp_jax import command_line
from hcp_jax.evaluation.statistics import write_json
from hcp_jax.evaluation.summary import summarise_runs
from hcp_jax.training import loop, run_folder
from hcp_jax.training.metrics import METRICS_FILE, read_rows


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.sweep",
        description="Runs a list of experiments with several seeds: skips what is done, resumes what was cut off.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("list", help="Python file whose get_configs() gives the experiments; it will be executed")
    parser.add_argument("--seeds", type=int, default=1, help="seeds 0 to SEEDS-1 of each experiment")
    parser.add_argument("--out", type=pathlib.Path, help="folder of run folders (default: runs/LIST)")
    parser.add_argument("--summary", type=pathlib.Path, help="JSON file for the table (default: OUT/summary.json)")
    known, overrides = parser.parse_known_args(arguments)
    with command_line.user_errors_end_the_command():
        configs = [command_line.apply_overrides(config, overrides) for config in command_line.load_configs(known.list)]
        command_line.enable_compilation_cache()
        out = known.out or pathlib.Path("runs") / pathlib.Path(known.list).stem
        folders = []
        for seed in range(known.seeds):
            for config in configs:
                folder = out / f"{config.name}_s{seed}"
                folders.append(folder)
                if run_experiment(dataclasses.replace(config, seed=seed), folder):
                    return
        write_json(known.summary or out / "summary.json", summarise_runs(folders))


def run_experiment(config, folder: pathlib.Path) -> bool:
    """Trains, resumes or skips one experiment. Returns whether the user interrupted it."""
    resume = (folder / run_folder.CONFIG_FILE).exists()
    if resume:
        rows = read_rows(folder / METRICS_FILE)
        if rows and int(rows[-1]["env_steps"]) >= config.total_env_steps:
            print(f"{folder}: done", flush=True)
            return False
    return loop.train(config, folder, resume) is None


if __name__ == "__main__":
    main()

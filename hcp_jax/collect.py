"""`python -m hcp_jax.collect RUNS --out results`: adds run folders to the results: policies, tables, curves, pictures."""

import pathlib

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.evaluation.arm_results import collect_arms
from hcp_jax.evaluation.hopper_results import collect_hoppers
from hcp_jax.evaluation.publishing import find_runs
from hcp_jax.training.run_folder import read_config


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.collect", description="Adds run folders to the results.")
    parser.add_argument("runs", type=pathlib.Path, help="folder of run folders")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder of results, whose tables are made anew")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        folders = find_runs(options.runs)
        if not folders:
            raise ConfigError(f"{options.runs}: holds no run folders with results")
        hoppers = [folder for folder in folders if read_config(folder).task == "hopper"]
        arms = [folder for folder in folders if folder not in hoppers]
        for collect, group in ((collect_hoppers, hoppers), (collect_arms, arms)):
            for line in collect(group, options.out) if group else ():
                print(line)


if __name__ == "__main__":
    main()

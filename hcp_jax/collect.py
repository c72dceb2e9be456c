"""`python -m hcp_jax.collect [RUNS] --out results`: adds run folders to the results: policies, tables, curves, pictures.

Without RUNS, tables, curves and pictures are made anew from what is published there.
"""

import pathlib

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.evaluation.arm_results import collect_arms
from hcp_jax.evaluation.hopper_results import collect_hoppers
from hcp_jax.evaluation.publishing import find_runs
from hcp_jax.training.run_folder import read_config


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.collect", description="Adds run folders to the results.")
    parser.add_argument("runs", type=pathlib.Path, nargs="?", help="folder of run folders; without it nothing is added")
    parser.add_argument(
        "--out", type=command_line.output_folder, required=True, help="folder of results, whose tables are made anew"
    )
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        added = find_runs(options.runs) if options.runs else []
        if options.runs and not added:
            raise ConfigError(f"{options.runs}: holds no run folders with results")
        hoppers = [folder for folder in added if read_config(folder).task == "hopper"]
        arms = [folder for folder in added if folder not in hoppers]
        lines = []
        for collect, group in ((collect_hoppers, hoppers), (collect_arms, arms)):
            if group or not options.runs:
                lines += collect(group, options.out)
        if not lines:
            raise ConfigError(f"{options.out}: holds no published runs to make tables of; name a folder of run folders")
        print(*lines, sep="\n")


if __name__ == "__main__":
    main()

"""`python -m hcp_jax.collect RUNS --out results`: publishes tables, curves, pictures and policies from run folders."""

import pathlib

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.evaluation.hopper_results import collect


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.collect", description="Writes results from run folders.")
    parser.add_argument("runs", type=pathlib.Path, help="folder of run folders")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder of results; its files are replaced")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        if not any(options.runs.glob("*/config.json")):
            raise ConfigError(f"{options.runs}: holds no run folders")
        for line in collect(options.runs, options.out):
            print(line)


if __name__ == "__main__":
    main()

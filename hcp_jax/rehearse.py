"""`python -m hcp_jax.rehearse RUN --robot my_arm.urdf|I:3 [--goals 20] [--json FILE]`: a reacher policy as on a real arm."""

import pathlib

from rich.table import Table

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.rehearsal import rehearse


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.rehearse",
        description="Plays a reacher policy on one arm with gravity compensation, sensor noise, jitter and delay.",
    )
    parser.add_argument("run", type=pathlib.Path, help="run folder")
    parser.add_argument(
        "--robot",
        required=True,
        help=f"I:3 (held-out robot 3 of a type), train:3 (one trained on); or {command_line.OWN_ARM}",
    )
    command_line.add_chain_options(parser)
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--seed", type=command_line.seed, default=0, help="seed of goals, start poses, noise and jitter")
    parser.add_argument("--json", type=command_line.output_file(".json"), help="file to write the whole record to")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        if options.goals < 1:
            raise ConfigError(f"--goals={options.goals}: expected at least 1")
        command_line.enable_compilation_cache()
        record = rehearse(options.run, options.robot, options.goals, options.base, options.tip, options.seed)
        print_record(record)
        if options.json:
            write_json(options.json, record)


def print_record(record: dict) -> None:
    table = Table(title=f"{record['run']} on {record['robot']}: quantiles of the final distance [m]")
    table.add_column("conditions")
    table.add_column("success [%]", justify="right")
    shares = next(iter(record["conditions"].values()))["final_distance_quantiles"]
    for share in shares:
        table.add_column(f"{float(share):.0%}", justify="right")
    for name, row in record["conditions"].items():
        distances = (f"{value:.3f}" for value in row["final_distance_quantiles"].values())
        table.add_row(name, f"{row['success']:.0f}", *distances)
    command_line.show(table)


if __name__ == "__main__":
    main()

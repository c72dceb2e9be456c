"""`python -m hcp_jax.benchmark physics|learner|train|scale [--config FILE] [--rows NAME ...] [--json FILE]`"""

import argparse
import math
from collections.abc import Iterable

import jax
from rich.table import Table

from hcp_jax import command_line, presets
from hcp_jax.benchmarks.learner import benchmark_learner
from hcp_jax.benchmarks.physics import ROWS, benchmark_physics
from hcp_jax.benchmarks.scale import benchmark_scale
from hcp_jax.benchmarks.training import PEERS, SUCCESS_ROWS, benchmark_success, benchmark_training
from hcp_jax.config import Config, ConfigError
from hcp_jax.evaluation.files import write_json
from hcp_jax.physics.build import resolve_physics
from hcp_jax.training.run_folder import describe_environment

SUBJECTS = ("physics", "learner", "train", "scale")


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.benchmark",
        description="Measures speed, side by side in one run.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("subject", choices=SUBJECTS)
    parser.add_argument("--config", help="experiment that is timed; default: the reacher of Exp. I, in batches of 1,024")
    parser.add_argument(
        "--batches", type=int, nargs="+", default=[1, 128, 1120, 8960], help="of physics: numbers of environments"
    )
    parser.add_argument("--sizes", type=int, nargs="+", default=[10, 100, 1000, 10000], help="of scale: numbers of robots")
    parser.add_argument("--rows", nargs="+", metavar="ROW", help="of physics and train; default: all")
    parser.add_argument("--to-success", type=float, help="of train: wall time until this share [%%] succeeds instead")
    parser.add_argument("--limit", type=float, default=3600.0, help="of --to-success: seconds after which a row is given up")
    parser.add_argument("--seconds", type=float, default=1.0, help="shortest time of one measurement")
    parser.add_argument("--json", type=command_line.output_file(".json"), help="file to write the rows to")
    options, overrides = parser.parse_known_args(arguments)
    with command_line.user_errors_end_the_command():
        for name in ("batches", "sizes"):
            if min(getattr(options, name)) < 1:
                raise ConfigError(f"--{name}={min(getattr(options, name))}: expected at least 1")
        for name in ("seconds", "limit"):
            if not 0.0 < getattr(options, name) < math.inf:
                raise ConfigError(f"--{name}={getattr(options, name)}: expected a number above 0")
        if options.to_success is not None and not 0.0 < options.to_success <= 100.0:
            raise ConfigError(f"--to-success={options.to_success}: expected above 0, at most 100")
        if options.config:
            config = command_line.load_config(options.config, overrides)
        else:
            config = command_line.apply_overrides(presets.arm("reacher", "reacher", "chain_fk", left_out="H"), overrides)
        if options.to_success is not None and options.subject != "train":
            raise ConfigError(f"--to-success: goes with train, not {options.subject}")
        rows_of = {"physics": ROWS, "train": ("hcp_jax", *PEERS[config.task])}
        allowed = rows_of.get(options.subject, ()) if options.to_success is None else SUCCESS_ROWS
        for row in options.rows or ():
            if row not in allowed:
                subject = options.subject + (" --to-success" if options.to_success is not None else "")
                raise ConfigError(f"--rows={row}: expected of {subject}: {', '.join(allowed) or 'none'}")
        if options.subject == "scale" and config.robot:
            raise ConfigError(f"robot={config.robot!r}: expected types of arms, or hoppers, for scale")
        if options.to_success is not None and config.task == "hopper":
            raise ConfigError("--to-success: the hopper has no success: expected a reacher or peg_insertion")
        command_line.enable_compilation_cache()
        machine, rows = describe_environment(resolve_physics(config.physics)), []
        for row in measure(options, config):
            rows.append(row)
            numbers = (f"{name} {format_number(value)}" for name, value in row.items() if isinstance(value, (int, float)))
            print(row["name"], *numbers, sep="  ", flush=True)
            if options.json:  # what is measured stays, if a later row is broken off
                write_json(options.json, {"machine": machine, "rows": rows})
        if options.subject == "physics":
            print_speeds(config.name, rows)
        else:
            print_rows(config.name, rows)


def measure(options: argparse.Namespace, config: Config) -> Iterable[dict]:
    """The rows of the chosen subject, as they come."""
    if options.subject == "physics":
        return benchmark_physics(config, options.batches, options.rows or list(ROWS), options.seconds)
    if options.subject == "learner":
        return benchmark_learner(config, options.seconds)
    if options.subject == "scale":
        return benchmark_scale(config, options.sizes, options.seconds)
    if options.to_success is None:
        return benchmark_training(config, options.rows or ["hcp_jax", *PEERS[config.task]], options.seconds)
    return benchmark_success(config, options.rows or list(SUCCESS_ROWS), options.to_success, options.limit)


def format_number(value: object) -> str:
    """With separators of thousands; what is no number as it is."""
    return f"{value:,}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def print_rows(title: str, rows: list[dict]) -> None:
    """A table with a column for everything that any row has."""
    table = Table(title=f"{title}, {jax.default_backend()}")
    columns = list(dict.fromkeys(name for row in rows for name in row if name != "task"))
    for column in columns:
        table.add_column(column.replace("_", " "), justify="left" if column == "name" else "right")
    for row in rows:
        cells = (row.get(column, "") for column in columns)
        table.add_row(*(format_number(cell) for cell in cells))
    command_line.show(table)


def print_speeds(title: str, rows: list[dict]) -> None:
    """Control steps per second, a row per engine and a column per batch; physics steps in a second table."""
    for unit in ("control", "physics"):
        table = Table(title=f"{title}: {unit} steps per second, {jax.default_backend()}")
        table.add_column("row")
        batches = list(dict.fromkeys(row["num_envs"] for row in rows))
        for batch in batches:
            table.add_column(f"{batch:,} envs", justify="right")
        for name in dict.fromkeys(row["name"] for row in rows):
            speeds = {row["num_envs"]: row[f"{unit}_steps_per_s"] for row in rows if row["name"] == name}
            table.add_row(name, *(f"{speeds[batch]:,.0f}" for batch in batches))
        command_line.show(table)


if __name__ == "__main__":
    main()

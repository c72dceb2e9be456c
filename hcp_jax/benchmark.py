"""`python -m hcp_jax.benchmark physics|learner [--config FILE] [--batches 1 128 1120 8960] [--rows native] [--json FILE]`"""

import argparse
import pathlib

import jax
from rich.console import Console
from rich.table import Table

from hcp_jax import command_line, presets
from hcp_jax.benchmarks.learner import benchmark_learner
from hcp_jax.benchmarks.physics import ROWS, benchmark_physics
from hcp_jax.config import ConfigError
from hcp_jax.evaluation.statistics import write_json
from hcp_jax.training.run_folder import describe_environment


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.benchmark",
        description="Measures speed, side by side in one run.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("subject", choices=["physics", "learner"])
    parser.add_argument("--config", help="experiment that is timed; default: the reacher of Exp. I")
    parser.add_argument(
        "--batches", type=int, nargs="+", default=[1, 128, 1120, 8960], help="of physics: numbers of environments"
    )
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS), help="of physics")
    parser.add_argument("--seconds", type=float, default=1.0, help="shortest time of one measurement")
    parser.add_argument("--json", type=pathlib.Path, help="file to write the rows to")
    options, overrides = parser.parse_known_args(arguments)
    with command_line.user_errors_end_the_command():
        if min(options.batches) < 1:
            raise ConfigError(f"--batches={min(options.batches)}: expected at least 1")
        if options.config:
            config = command_line.load_config(options.config, overrides)
        else:
            config = command_line.apply_overrides(presets.arm("reacher", "reacher", "chain_fk", left_out="H"), overrides)
        command_line.enable_compilation_cache()
        if options.subject == "learner":
            rows = benchmark_learner(config, options.seconds)
            print_durations(config.name, rows)
        else:
            rows = []
            for row in benchmark_physics(config, options.batches, options.rows, options.seconds):
                rows.append(row)
                speed = f"{row['control_steps_per_second']:>13,.0f} control steps/s"
                print(f"{row['name']:>13} {row['num_envs']:>7,} environments {speed}", flush=True)
            print_speeds(config.name, rows)
    if options.json:
        write_json(options.json, {"environment": describe_environment(config.physics), "rows": rows})


def print_durations(title: str, rows: list[dict]) -> None:
    """What a training iteration and its parts take."""
    table = Table(title=f"{title}: {rows[0]['num_envs']:,} environments, {jax.default_backend()}")
    for column in ("row", "milliseconds", "control steps/s", "replay buffer"):
        table.add_column(column, justify="left" if column == "row" else "right")
    for row in rows:
        speed, size = row.get("control_steps_per_second"), row.get("replay_bytes")
        cells = (f"{speed:,.0f}" if speed else "", f"{size / 1e6:,.0f} MB" if size else "")
        table.add_row(row["name"], f"{1e3 * row['seconds']:,.1f}", *cells)
    Console().print(table)


def print_speeds(title: str, rows: list[dict]) -> None:
    """Control steps per second, a row per engine and a column per batch; physics steps in a second table."""
    for unit in ("control", "physics"):
        table = Table(title=f"{title}: {unit} steps per second, {jax.default_backend()}")
        table.add_column("row")
        batches = list(dict.fromkeys(row["num_envs"] for row in rows))
        for batch in batches:
            table.add_column(f"{batch:,} envs", justify="right")
        for name in dict.fromkeys(row["name"] for row in rows):
            speeds = {row["num_envs"]: row[f"{unit}_steps_per_second"] for row in rows if row["name"] == name}
            table.add_row(name, *(f"{speeds[batch]:,.0f}" for batch in batches))
        Console().print(table)


if __name__ == "__main__":
    main()

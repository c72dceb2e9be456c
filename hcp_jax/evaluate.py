"""`python -m hcp_jax.evaluate RUN [--types H] [--trials 10] [--robots-per-trial 100] [--physics native-rk4] [--json FILE]`"""

import argparse
import pathlib

from rich.table import Table

from hcp_jax import command_line
from hcp_jax.config import Config, ConfigError
from hcp_jax.evaluation.arm_sweeps import evaluate_arms
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.hopper_sweeps import evaluate_hoppers
from hcp_jax.evaluation.new_robots import RangeChange, check_types
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.training.run_folder import read_config


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.evaluate", description="Evaluates the policy of a run folder.")
    parser.add_argument("run", type=pathlib.Path, help="run folder")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--robots-per-trial", type=int, default=100)
    command_line.add_physics_option(parser)
    parser.add_argument("--fit-steps", type=int, help="control steps of each new robot for fitting its v_h (HCP-I); 0 skips it")
    parser.add_argument(
        "--first-steps",
        type=int,
        nargs="+",
        default=(),
        metavar="N",
        help="also regress v_h of each new robot from its first N control steps (HCP-I with identification): 50 200 1000",
    )
    parser.add_argument("--types", nargs="*", help="robot types to evaluate: A to K, of the reacher A to I and R4 to R7")
    parser.add_argument(
        "--range",
        nargs=3,
        action="append",
        default=[],
        metavar=("NAME", "LOW", "HIGH"),
        help="draw the new robots' hardware from another range than in training: --range damping 30 40",
    )
    parser.add_argument("--pool", type=pathlib.Path, help="take the new robots from a folder that RobotPool.save wrote")
    parser.add_argument("--robot", help=command_line.OWN_ARM)
    command_line.add_chain_options(parser)
    parser.add_argument("--seed", type=command_line.seed, default=0, help="seed of the initial states")
    parser.add_argument("--best", action="store_true", help="the best checkpoint instead of the newest")
    parser.add_argument("--json", type=command_line.output_file(".json"), help="file to write the whole record to")
    parser.add_argument("--without-robots", action="store_true", help="leave the rows of single robots out of that file")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        config = read_config(options.run)
        task = config.task
        check_options(options, config)
        command_line.enable_compilation_cache()
        settings = {name: getattr(options, name) for name in ("trials", "robots_per_trial", "physics", "seed", "best")}
        settings |= {"ranges": [read_range(*words) for words in options.range], "pool_folder": options.pool}
        if task == "hopper":
            record = evaluate_hoppers(options.run, fit_steps=options.fit_steps, first_steps=options.first_steps, **settings)
        else:
            if options.robot is not None:
                robot = load_robot(options.robot, options.base, options.tip)
                settings["own_robots"] = {pathlib.Path(options.robot).stem: robot}
            record = evaluate_arms(options.run, types=options.types or (), **settings)
        print_table(record)
        if options.json:
            left_out = ("robots",) if options.without_robots else ()
            write_json(options.json, {name: value for name, value in record.items() if name not in left_out})


def check_options(options: argparse.Namespace, config: Config) -> None:
    """Raises ConfigError for options that are out of range, or would be ignored beside the others or with this policy."""
    for name in ("trials", "robots_per_trial"):
        if getattr(options, name) < 1:
            raise ConfigError(f"--{name.replace('_', '-')}={getattr(options, name)}: expected at least 1")
    check_types(config, options.types or ())
    if options.pool and options.range:
        raise ConfigError("--range: not with --pool, whose robots are drawn already")
    if (options.fit_steps or 0) < 0:
        raise ConfigError(f"--fit-steps={options.fit_steps}: expected at least 0")
    if min(options.first_steps, default=1) < 1:
        raise ConfigError(f"--first-steps={min(options.first_steps)}: expected at least 1")
    for name in ("first_steps", "fit_steps"):
        if getattr(options, name) and config.task != "hopper":
            raise ConfigError(f"--{name.replace('_', '-')}: goes with a policy of hoppers")
    if options.fit_steps and config.encoding != "embedding":
        raise ConfigError(f"--fit-steps: goes with a learned v_h (encoding embedding), and this policy's is {config.encoding}")
    if (options.base or options.tip) and options.robot is None:
        raise ConfigError("--base, --tip: go with --robot")
    if options.robot is not None and (config.task == "hopper" or options.types or options.pool or options.range):
        raise ConfigError("--robot: goes with a policy of arms, and not with --types, --pool or --range")


def read_range(name: str, low: str, high: str) -> RangeChange:
    """The words of one `--range`."""
    try:
        return name, float(low), float(high)
    except ValueError as error:
        raise ConfigError(f"--range {name}={low} {high}: expected two numbers") from error


def print_table(record: dict) -> None:
    """Shows the record's sets of hoppers or types of arms, one row each."""
    title = f"{record['run']}: {record['encoding']}, {record['checkpoint_env_steps']:,} steps, {record['physics']}"
    table = Table(title=f"{title}, {record['trials']} trials x {record['robots_per_trial']} robots")
    if record["task"] == "hopper":
        rows, columns = record["sets"], {"return": "return_mean", "std over trials": "return_std"}
    else:
        rows = {f"{name}{' (zero-shot)' * row['zero_shot']}": row for name, row in record["types"].items()}
        columns = {
            "success [%]": "success_mean",
            "std over trials": "success_std",
            "of reachable goals [%]": "reachable_success_mean",
            "of arms without immovable joints [%]": "movable_success_mean",
        }
    columns |= {"episode length": "episode_length_mean"}
    table.add_column("robots", no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right")
    for name, values in rows.items():
        table.add_row(name, *("n/a" if values[key] is None else f"{values[key]:.1f}" for key in columns.values()))
    command_line.show(table)


if __name__ == "__main__":
    main()

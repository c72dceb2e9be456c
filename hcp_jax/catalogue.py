"""`python -m hcp_jax.catalogue POLICY ... [--fine-tuned RUN ...] [--json FILE]`: policies on real arms, beside each other."""

import argparse
import pathlib

import numpy as np
from rich.table import Table

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.evaluation.catalogue_table import make_catalogue_table
from hcp_jax.evaluation.files import write_json
from hcp_jax.hardware.catalogue import catalogue_names


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.catalogue",
        description="Plays policies on every arm of the catalogue, without training and after fine-tuning.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("policies", nargs="+", type=pathlib.Path, help="run folders or published policies of arms")
    parser.add_argument("--fine-tuned", nargs="*", type=pathlib.Path, default=[], help="run folders of experiments/finetune.py")
    parser.add_argument("--robots", nargs="*", default=[], help=f"some of {', '.join(catalogue_names())}; all if left out")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--episodes-per-trial", type=int, default=100)
    command_line.add_physics_option(parser)
    parser.add_argument("--json", type=command_line.output_file(".json"), help="file to write the table to")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        for name in ("trials", "episodes_per_trial"):
            if getattr(options, name) < 1:
                raise ConfigError(f"--{name.replace('_', '-')}={getattr(options, name)}: expected at least 1")
        command_line.enable_compilation_cache()
        settings = {"trials": options.trials, "episodes_per_trial": options.episodes_per_trial}
        settings |= {"names": options.robots, "physics": options.physics}
        rows = make_catalogue_table(options.policies, options.fine_tuned, **settings)
        print_table(rows)
        if options.json:
            write_json(options.json, rows)


def print_table(rows: list[dict]) -> None:
    """One row per arm, a column for each policy, and their medians over the arms that it was not trained on."""
    names = [pathlib.Path(part["policy"]).name for part in rows[0]["zero_shot"]]
    table = Table(title="success [%] on the goals of the task")
    for head in ("arm", "goals in reach [%]", *names, "fine-tuned"):
        table.add_column(head, justify="left" if head == "arm" else "right")
    for row in rows:
        shown = [f"{part['success_mean']:.1f}" + " (trained on it)" * part["trained"] for part in row["zero_shot"]]
        tuned = f"{row['fine_tuned']['success_mean']:.1f}" if row["fine_tuned"] else "n/a"
        table.add_row(row["robot"], f"{row['reachable_share']:.1f}", *shown, tuned)
    command_line.show(table)
    for column, name in enumerate(names):
        parts = [row["zero_shot"][column] for row in rows]
        successes = [part["success_mean"] for part in parts if not part["trained"]]
        if successes:
            command_line.show(f"median zero-shot success: {np.median(successes):.1f} %, {name}")


if __name__ == "__main__":
    main()

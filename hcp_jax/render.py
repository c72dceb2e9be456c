"""`python -m hcp_jax.render RUN --robots H:3 [B:0 ...] --out FILE.mp4|.gif|.png`: what a policy does, as video or pictures."""

import pathlib

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.experiment.chosen_robots import Choice, read_choice
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.rendering.film import MAX_ROBOTS, check_output, write_film
from hcp_jax.rendering.graphics import choose_backend
from hcp_jax.rendering.recording import record_episodes
from hcp_jax.training.run_folder import read_config


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.render", description="Films the policy of a run folder, headless.")
    parser.add_argument("run", type=pathlib.Path, help="run folder, or one under results/policies")
    robots = parser.add_mutually_exclusive_group(required=True)
    robots.add_argument(
        "--robots", nargs="+", metavar="TYPE:ROW", help="held-out robots: H:3, hopper:0 (train:0: a hopper that was trained on)"
    )
    robots.add_argument("--grid", action="store_true", help="the first held-out robot of every type; nine hoppers")
    robots.add_argument("--robot", help=command_line.OWN_ARM)
    command_line.add_chain_options(parser)
    parser.add_argument(
        "--out", type=command_line.new_output, required=True, help=".mp4, .gif, or .png for a few pictures in a row"
    )
    parser.add_argument("--pictures", type=int, default=5, help="of each robot in a .png; 1 shows the ends of the episodes")
    command_line.add_physics_option(parser)
    parser.add_argument("--seed", type=command_line.seed, default=0, help="seed of start poses, goals and noise")
    parser.add_argument("--best", action="store_true", help="the best checkpoint instead of the newest")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        if options.pictures < 1:
            raise ConfigError(f"--pictures={options.pictures}: expected at least 1")
        chosen = [read_robot(word) for word in options.robots or ()]
        if len(chosen) > MAX_ROBOTS:
            raise ConfigError(f"--robots: {len(chosen)} of them: expected at most {MAX_ROBOTS}")
        if (options.base or options.tip) and options.robot is None:
            raise ConfigError("--base, --tip: go with --robot")
        if options.robot is not None and read_config(options.run).task == "hopper":
            raise ConfigError("--robot: goes with a policy of arms")
        check_output(options.out)
        backend = choose_backend()
        own = None
        if options.robot is not None:
            own = (pathlib.Path(options.robot).stem, load_robot(options.robot, options.base, options.tip))
        command_line.enable_compilation_cache()
        recording = record_episodes(options.run, chosen, own, options.physics, options.seed, options.best)
        for name, outcome in zip(recording.names, recording.outcomes, strict=True):
            print(f"{name}: {outcome}", flush=True)
        write_film(recording, options.out, backend, options.pictures)
        print(f"wrote {options.out}")


def read_robot(word: str) -> Choice:
    """A word of `--robots`. Raises ConfigError."""
    choice = read_choice(word)
    if choice is None:
        raise ConfigError(f"--robots={word}: expected TYPE:ROW, such as H:3")
    return choice


if __name__ == "__main__":
    main()

"""`python -m hcp_jax.train --config experiments/NAME.py [--out runs/NAME] [--resume] [--config.FIELD=VALUE ...]`"""

import pathlib

from hcp_jax import command_line
from hcp_jax.devices import join_processes
from hcp_jax.training import loop


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.train", description="Trains one policy for a pool of robots.")
    parser.add_argument("--config", required=True, help="experiment file; it is Python and will be executed")
    parser.add_argument("--out", type=pathlib.Path, help="run folder (default: runs/NAME)")
    parser.add_argument("--resume", action="store_true", help="go on from the run folder's newest checkpoint")
    parser.add_argument("--distributed", action="store_true", help="trains together with other processes")
    known, overrides = parser.parse_known_args(arguments)
    with command_line.user_errors_end_the_command():
        if known.distributed:
            join_processes()
        config = command_line.load_config(known.config, overrides)
        command_line.enable_compilation_cache()
        loop.train(config, known.out or pathlib.Path("runs") / config.name, known.resume)


if __name__ == "__main__":
    main()

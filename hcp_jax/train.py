"""`python -m hcp_jax.train --config experiments/NAME.py [--out runs/NAME] [--resume] [--config.FIELD=VALUE ...]`

`--resume --out runs/NAME` alone goes on with the settings that the run was started with.
"""

import pathlib

from hcp_jax import command_line
from hcp_jax.devices import join_processes
from hcp_jax.training import loop, run_folder


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.train", description="Trains one policy for a pool of robots.")
    parser.add_argument(
        "--config", help="experiment file; it is Python and will be executed. Not needed to --resume --out FOLDER"
    )
    parser.add_argument("--out", type=command_line.new_output, help="run folder (default: runs/NAME)")
    parser.add_argument("--resume", action="store_true", help="go on from the run folder's newest checkpoint")
    parser.add_argument("--distributed", action="store_true", help="trains together with other processes")
    known, overrides = parser.parse_known_args(arguments)
    if known.config is None and not (known.resume and known.out):
        parser.error("the following arguments are required: --config, unless --resume --out FOLDER goes on with a run")
    with command_line.user_errors_end_the_command():
        if known.distributed:
            join_processes()
        if known.config is None:
            config = command_line.apply_overrides(run_folder.read_config(known.out), overrides)
        else:
            config = command_line.load_config(known.config, overrides)
        command_line.enable_compilation_cache()
        loop.train(config, known.out or pathlib.Path("runs") / config.name, known.resume)


if __name__ == "__main__":
    main()

"""`python -m hcp_jax.view RUN [--host localhost] [--port 8080]`: an arm under a policy, in the browser."""

import contextlib
import pathlib

from hcp_jax import command_line
from hcp_jax.config import ConfigError
from hcp_jax.rendering.browser import open_view


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.view", description="Shows an arm in the browser; its type, its links and its goal can be dragged."
    )
    parser.add_argument("run", type=pathlib.Path, help="run folder of arms, or one under results/policies")
    parser.add_argument("--host", default="localhost", help="address to listen at; anybody who reaches it can use the view")
    parser.add_argument("--port", type=int, default=8080, help="the first free one from here on is taken")
    parser.add_argument("--best", action="store_true", help="the best checkpoint instead of the newest")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        if not 1 <= options.port <= 65535:
            raise ConfigError(f"--port={options.port}: expected 1 to 65535")
        command_line.enable_compilation_cache()
        view = open_view(options.run, options.host, options.port, options.best)
        print(f"http://{options.host}:{view.server.get_port()} (Ctrl-C ends it)", flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            view.run()
        view.server.stop()


if __name__ == "__main__":
    main()

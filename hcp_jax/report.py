"""`python -m hcp_jax.report results/ --out report.html`: one page with tables and figures beside the paper's."""

import pathlib

from hcp_jax import command_line
from hcp_jax.reporting.build import write_report


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(prog="hcp_jax.report", description="Writes a page of results; it loads nothing.")
    parser.add_argument("results", type=pathlib.Path, help="folder that hcp_jax.collect wrote")
    parser.add_argument(
        "--out", type=command_line.output_file(".html"), required=True, help="HTML file; an older report is replaced"
    )
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        for line in write_report(options.results, options.out):
            print(line)


if __name__ == "__main__":
    main()

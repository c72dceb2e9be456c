"""`python -m hcp_jax.export RUN --robot my_arm.urdf|H:3 --out FOLDER`: a policy for one robot, to run without this package."""

import pathlib

from hcp_jax import command_line
from hcp_jax.deployment.artefacts import DESCRIPTION_FILE, JAX_FILE, MODEL_FILE, ONNX_FILE, export_policy


def main(arguments: list[str] | None = None) -> None:
    parser = command_line.OneLineParser(
        prog="hcp_jax.export", description="Writes a policy for one robot as ONNX and jax.export."
    )
    parser.add_argument("run", type=pathlib.Path, help="run folder")
    parser.add_argument(
        "--robot",
        required=True,
        help=f"H:3 (held-out robot 3 of a type), train:3 (one trained on); or {command_line.OWN_ARM}",
    )
    command_line.add_chain_options(parser)
    parser.add_argument("--out", type=command_line.new_output, required=True, help="new folder")
    parser.add_argument("--best", action="store_true", help="the best checkpoint instead of the newest")
    options = parser.parse_args(arguments)
    with command_line.user_errors_end_the_command():
        command_line.enable_compilation_cache()
        description = export_policy(options.run, options.robot, options.out, options.base, options.tip, options.best)
    sizes = [description[end]["shape"][0] for end in ("input", "output")]
    print(f"{options.out}: {description['robot']}, {sizes[0]} numbers in, {sizes[1]} torques out, every")
    print(f"{description['control_period']:g} s: {ONNX_FILE}, {JAX_FILE}, {MODEL_FILE}; {DESCRIPTION_FILE} says what they mean")


if __name__ == "__main__":
    main()

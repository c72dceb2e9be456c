"""The sixteen trainings of the paper's table 1, in its order, for `python -m hcp_jax.sweep`."""

import pathlib
import runpy

from hcp_jax.config import Config

NAMES = (
    "reacher_film_leave_h",
    "reacher_ddpg_leave_h",
    "reacher_film_leave_e",
    "reacher_ddpg_leave_e",
    "peg_film_leave_h",
    "peg_ddpg_leave_h",
    "peg_film_leave_e",
    "peg_ddpg_leave_e",
    "peg_film_leave_i",
    "peg_ddpg_leave_i",
    "random_peg_film_leave_h",
    "random_peg_ddpg_leave_h",
    "random_peg_film_leave_e",
    "random_peg_ddpg_leave_e",
    "random_peg_film_leave_i",
    "random_peg_ddpg_leave_i",
)


def get_configs() -> list[Config]:
    folder = pathlib.Path(__file__).parent
    return [runpy.run_path(str(folder / f"{name}.py"))["get_config"]() for name in NAMES]

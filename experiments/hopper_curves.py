"""The learning curves of the paper's figure 4a: PPO, HCP-E, HCP-E with dynamics, and HCP-I in both forms. For `sweep`."""

import pathlib
import runpy

from hcp_jax.config import Config

NAMES = ("hopper_ppo", "hopper_hcpe", "hopper_hcpe_dyn", "hopper_hcpi", "hopper_hcpi_plain")


def get_configs() -> list[Config]:
    folder = pathlib.Path(__file__).parent
    return [runpy.run_path(str(folder / f"{name}.py"))["get_config"]() for name in NAMES]

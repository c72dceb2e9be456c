"""Transfer to 100 new hoppers: every layer from an HCP-I run, v_h identified anew. Preset: fast.

The policy starts as it was and takes small steps; `--config.init=FOLDER` names another run or policy to start from.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper_finetune(
        "hopper_finetune", 1e-4, 320_000, total_env_steps=3_200_000, init="runs/hopper_hcpi", init_layers="all"
    )

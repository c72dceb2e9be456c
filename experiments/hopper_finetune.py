"""Transfer to 100 new hoppers: every layer from an HCP-I run, v_h identified anew. Preset: fast.

The policy, which is the published one of seed 0, starts as it was and takes small steps; `--config.init=FOLDER` names another
run or policy.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper_finetune(
        "hopper_finetune", 1e-4, 320_000, total_env_steps=3_200_000, init="results/policies/hopper_hcpi_s0", init_layers="all"
    )

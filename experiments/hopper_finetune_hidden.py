"""Transfer to 100 new hoppers (paper, figure 4b): hidden layers from an HCP-I run, new output layers and v_h. Preset: fast.

They are those of the published policy of seed 0; `--config.init=FOLDER` names another run or policy.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper_finetune("hopper_finetune_hidden", 6e-4, 160_000, init="results/policies/hopper_hcpi_s0")

"""HCP-E on 1000 hoppers: v_h is the links' lengths (paper, section 3.1). Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper("hopper_hcpe", encoding="kinematics")

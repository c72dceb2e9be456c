"""HCP-I as the paper states it: v_h learns from the gradients of policy and value loss. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper("hopper_hcpi_plain", encoding="embedding")

"""HCP-I on 1000 hoppers: v_h is learned (paper, section 3.2), here first of all, by predicting the motion. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper("hopper_hcpi", encoding="embedding", embedding=presets.IDENTIFIED_EMBEDDING)

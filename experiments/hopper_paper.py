"""HCP-I with the paper's own hyperparameters (appendix, "Hyperparameters for hopper"): 8 environments, RK4. Preset: paper."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper_paper("hopper_paper", encoding="embedding")

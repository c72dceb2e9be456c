"""PPO without v_h on 1000 hoppers: the baseline of the paper's figure 4a. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper("hopper_ppo", encoding="none")

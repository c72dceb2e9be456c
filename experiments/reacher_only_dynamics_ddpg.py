"""Type I, dynamics alone differ (paper, appendix): reacher; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("reacher_only_dynamics_ddpg", "reacher", "none", presets.only_dynamics())

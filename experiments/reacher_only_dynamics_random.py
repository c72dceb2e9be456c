"""Type I, dynamics alone differ (paper, appendix): reacher; DDPG+HER with random numbers as v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("reacher_only_dynamics_random", "reacher", "random", presets.only_dynamics())

"""Type I, dynamics alone differ (paper, appendix): peg insertion, fixed hole; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("peg_only_dynamics_ddpg", "peg_insertion", "none", presets.only_dynamics())

"""Type I, dynamics alone differ (paper, appendix): peg insertion; DDPG+HER with the dynamics as v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("peg_only_dynamics_dynamics", "peg_insertion", "dynamics", presets.only_dynamics())

"""Type I, 7-DOF curves (paper, appendix): peg insertion, fixed hole; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("peg_7dof_ddpg", "peg_insertion", "none", presets.only("I"))

"""Type I, 7-DOF curves (paper, appendix): peg insertion, fixed hole; HCP-E+Dyn. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("peg_7dof_hcpe_dyn", "peg_insertion", "chain+dynamics", presets.only("I"))

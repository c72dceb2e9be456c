"""Type I, 7-DOF curves (paper, appendix): reacher; HCP-E+Dyn. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("reacher_7dof_hcpe_dyn", "reacher", "chain+dynamics", presets.only("I"))

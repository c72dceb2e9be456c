"""Type I, 7-DOF curves (paper, appendix): reacher; HCP-I. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("reacher_7dof_hcpi", "reacher", "embedding", presets.only("I"))

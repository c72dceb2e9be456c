"""Type I, 7-DOF curves (paper, appendix): reacher; HCP-E as released. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("reacher_7dof_hcpe", "reacher", "chain_fk", pool=presets.only("I"))

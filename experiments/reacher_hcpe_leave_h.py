"""Exp. I of the paper: reacher, random goals, type H left out; HCP-E as released. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("reacher_hcpe_leave_h", "reacher", "chain_fk", left_out="H")

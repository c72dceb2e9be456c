"""Exp. IX of the paper: peg insertion, type I left out; HCP-E, Jacobians and aligned joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.aligned_peg("peg_aligned_leave_i", left_out="I")

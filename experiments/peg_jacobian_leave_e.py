"""Exp. VII of the paper: peg insertion, fixed hole, type E left out; HCP-E with Jacobians, packed joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_jacobian_leave_e", "peg_insertion", "chain_fk+jacobian", left_out="E")

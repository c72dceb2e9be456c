"""Exp. XI of the paper: peg insertion, random hole, type H left out; HCP-E with Jacobians, packed joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm(
        "random_peg_jacobian_leave_h", "peg_insertion", "chain_fk+jacobian", left_out="H", random_hole=presets.RANDOM_HOLE
    )

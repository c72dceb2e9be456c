"""Exp. V with joint poses and Jacobians at the current joint angles."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_jacobian_leave_h", "peg_insertion", "chain_fk+jacobian", left_out="H")

"""Exp. V with joint poses, Jacobians and what each motor is up against (dynamics) at the current joint angles."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_dynamics_leave_h", "peg_insertion", "chain_fk+jacobian+dynamics", left_out="H")

"""Exp. V of the paper: peg insertion, fixed hole, type H left out; HCP-E, Jacobians, aligned joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_aligned_leave_h", "peg_insertion", "chain_fk+jacobian", left_out="H", joint_slots="aligned")

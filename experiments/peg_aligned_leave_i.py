"""Exp. IX of the paper: peg insertion, fixed hole, type I left out; HCP-E, Jacobians, aligned joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_aligned_leave_i", "peg_insertion", "chain_fk+jacobian", left_out="I", joint_slots="aligned")

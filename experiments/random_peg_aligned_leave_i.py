"""Exp. XV of the paper: peg insertion, random hole, type I left out; HCP-E, Jacobians, aligned joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm(
        "random_peg_aligned_leave_i",
        "peg_insertion",
        "chain_fk+jacobian",
        left_out="I",
        random_hole=presets.RANDOM_HOLE,
        joint_slots="aligned",
    )

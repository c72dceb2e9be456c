"""Exp. XIII of the paper: random hole, type E left out; HCP-E, Jacobians, aligned joints. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.aligned_peg("random_peg_aligned_leave_e", left_out="E", random_hole=presets.RANDOM_HOLE)

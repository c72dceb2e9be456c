"""Exp. III of the paper: reacher, random goals, type E left out; HCP-E, aligned joints. Preset: fast with small batches."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.quick_reacher("reacher_aligned_leave_e", left_out="E")

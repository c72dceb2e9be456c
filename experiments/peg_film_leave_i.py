"""Exp. IX of the paper: peg insertion, fixed hole, type I left out; HCP-E, Jacobians, aligned joints, FiLM. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.film_peg("peg_film_leave_i", left_out="I")

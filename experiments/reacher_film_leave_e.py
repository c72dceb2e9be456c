"""Exp. III: reacher, random goals, type E left out; HCP-E, aligned joints, FiLM. Preset: fast with small batches."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.film_reacher("reacher_film_leave_e", left_out="E")

"""Exp. XIII of the paper, where v_h and its features also scale and shift the hidden layers (FiLM). Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.aligned_peg("random_peg_film_leave_e", left_out="E", random_hole=presets.RANDOM_HOLE, network="film")

"""Exp. XIII of the paper, where v_h and its features also scale and shift the hidden layers (FiLM). Preset: fast."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    ddpg = dataclasses.replace(presets.FAST_PEG_DDPG, network="film")
    return presets.aligned_peg("random_peg_film_leave_e", left_out="E", random_hole=presets.RANDOM_HOLE, ddpg=ddpg)

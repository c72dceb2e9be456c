"""Exp. XIII of the paper, where v_h and its features also scale and shift the hidden layers (FiLM). Preset: fast."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm(
        "random_peg_film_leave_e",
        "peg_insertion",
        "chain_fk+jacobian",
        left_out="E",
        random_hole=presets.RANDOM_HOLE,
        joint_slots="aligned",
        ddpg=dataclasses.replace(presets.FAST_PEG_DDPG, network="film"),
    )

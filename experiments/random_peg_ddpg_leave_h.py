"""Exp. XII of the paper: peg insertion, random hole, type H left out; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("random_peg_ddpg_leave_h", "peg_insertion", "none", left_out="H", random_hole=presets.RANDOM_HOLE)

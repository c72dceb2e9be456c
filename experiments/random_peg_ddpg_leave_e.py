"""Exp. XIV of the paper: peg insertion, random hole, type E left out; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("random_peg_ddpg_leave_e", "peg_insertion", "none", left_out="E", random_hole=presets.RANDOM_HOLE)

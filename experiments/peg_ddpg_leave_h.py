"""Exp. VI of the paper: peg insertion, fixed hole, type H left out; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_ddpg_leave_h", "peg_insertion", "none", left_out="H")

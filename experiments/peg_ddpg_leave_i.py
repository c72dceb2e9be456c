"""Exp. X of the paper: peg insertion, fixed hole, type I left out; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("peg_ddpg_leave_i", "peg_insertion", "none", left_out="I")

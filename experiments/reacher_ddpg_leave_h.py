"""Exp. II of the paper: reacher, random goals, type H left out; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm("reacher_ddpg_leave_h", "reacher", "none", left_out="H")

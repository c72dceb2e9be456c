"""Exp. I with the constant v_h of the paper's text (`chain`), three times as long and in small batches. Preset: fast."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm(
        "reacher_chain_long_leave_h",
        "reacher",
        "chain",
        left_out="H",
        total_env_steps=15_360_000,
        eval_every=512_000,
        ddpg=dataclasses.replace(presets.FAST_DDPG, **presets.SMALL_BATCHES),
    )

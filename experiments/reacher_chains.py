"""The reacher on random chains of 5 to 7 joints, whose ranges enclose the catalogue's arms. Preset: fast with small batches."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import ArmPoolConfig, Config


def get_config() -> Config:
    return presets.arm(
        "reacher_chains",
        "reacher",
        "chain_fk+jacobian+dynamics",
        pool=ArmPoolConfig(types=("R5", "R6", "R7"), left_out=(), robots_per_type=300, heldout_per_type=40),
        total_env_steps=3_840_000,
        ddpg=dataclasses.replace(presets.FAST_DDPG, **presets.SMALL_BATCHES),
    )

"""The paper's embedding figure: 1000 hoppers that differ in torso mass only, v_h of width 2. Preset: fast."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config, HopperPoolConfig
from hcp_jax.hardware.ranges import torso_mass_only


def get_config() -> Config:
    return presets.hopper(
        "hopper_embedding",
        encoding="embedding",
        total_env_steps=5_000_000,
        eval_every=1_000_000,
        pool=HopperPoolConfig(ranges=torso_mass_only()),
        embedding=dataclasses.replace(presets.IDENTIFIED_EMBEDDING, size=2, fit_steps=0),
    )

"""Stress test (paper, "How robust"): peg insertion, type I, trained at damping 0.01 to 2; HCP-E, FiLM. Preset: fast."""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    config = presets.type_i(
        "peg_low_damping_film", "peg_insertion", "chain_fk+jacobian", presets.only_dynamics(damping=(0.01, 2.0))
    )
    return dataclasses.replace(config, ddpg=dataclasses.replace(config.ddpg, network="film", actor_average=0.985))

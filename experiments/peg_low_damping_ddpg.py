"""Stress test (paper, "How robust"): peg insertion, type I, trained at damping 0.01 to 2; DDPG+HER, no v_h. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.type_i("peg_low_damping_ddpg", "peg_insertion", "none", presets.only_dynamics(damping=(0.01, 2.0)))

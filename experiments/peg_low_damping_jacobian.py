"""Stress test (paper, "How robust"): peg insertion, type I, trained at damping 0.01 to 2; HCP-E, Jacobians. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    pool = presets.only_dynamics(damping=(0.01, 2.0))
    return presets.type_i("peg_low_damping_jacobian", "peg_insertion", "chain_fk+jacobian", pool)

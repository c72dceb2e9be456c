"""The reacher on random chains of 5 to 7 joints, in ranges that enclose the arms of the catalogue. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import ArmPoolConfig, Config


def get_config() -> Config:
    pool = ArmPoolConfig(types=("R5", "R6", "R7"), left_out=(), robots_per_type=300, heldout_per_type=40)
    return presets.arm("reacher_chains", "reacher", "chain_fk+jacobian+dynamics", pool=pool)

"""HCP-E with ground-truth dynamics on 1000 hoppers: v_h is lengths, masses, friction, damping, armature. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper("hopper_hcpe_dyn", encoding="kinematics+dynamics")

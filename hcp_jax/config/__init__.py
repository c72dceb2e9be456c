"""Every setting, as frozen dataclasses that check themselves when built. This is where other packages import them from."""

from hcp_jax.config.arm import ArmConfig, ArmPoolConfig
from hcp_jax.config.checks import MAX_SEED, ConfigError
from hcp_jax.config.conversion import field_names, from_dict, to_dict, unknown_field
from hcp_jax.config.ddpg import DDPGConfig
from hcp_jax.config.embedding import EmbeddingConfig
from hcp_jax.config.hopper import HopperConfig, HopperPoolConfig
from hcp_jax.config.ppo import PPOConfig
from hcp_jax.config.run import Config

__all__ = [
    "MAX_SEED",
    "ArmConfig",
    "ArmPoolConfig",
    "Config",
    "ConfigError",
    "DDPGConfig",
    "EmbeddingConfig",
    "HopperConfig",
    "HopperPoolConfig",
    "PPOConfig",
    "field_names",
    "from_dict",
    "to_dict",
    "unknown_field",
]

"""100 new hoppers without a policy to start from: what the fine-tuned ones are compared with. Preset: fast.

Without a forward model to start from, identification takes longer.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.hopper_finetune("hopper_finetune_scratch", 6e-4, 1_280_000)

"""What fine-tuning Exp. XV is compared to: HCP-E with type I alone, from the start. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.scratch_peg("random_peg_finetune_i_scratch", "I")

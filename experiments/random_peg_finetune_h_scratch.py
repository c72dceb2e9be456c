"""What fine-tuning Exp. XI is compared to: HCP-E, FiLM, with type H alone, from the start. Preset: fast."""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.scratch_peg("random_peg_finetune_h_scratch", "H", network="film")

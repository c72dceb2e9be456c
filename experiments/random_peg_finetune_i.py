"""Fine-tuning Exp. XV: HCP-E that never saw type I goes on with type I alone. Preset: fast, smaller steps.

`--config.init=FOLDER` names another run or policy to start from; `random_peg_finetune_i_scratch.py` starts from none.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.finetune_peg("random_peg_finetune_i", "I", init="results/policies/random_peg_aligned_leave_i_s0")

"""Fine-tuning Exp. XI: HCP-E that never saw type H goes on with type H alone. Preset: fast, smaller steps.

`--config.init=FOLDER` names another run or policy to start from; `random_peg_finetune_h_scratch.py` starts from none.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    init = "results/policies/random_peg_film_leave_h_s0"
    return presets.finetune_peg("random_peg_finetune_h", "H", init=init, network="film")

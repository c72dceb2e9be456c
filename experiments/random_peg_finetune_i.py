"""Fine-tuning Exp. XV: HCP-E that never saw type I goes on with type I alone. Preset: fast.

Set `--config.init=runs/random_peg_aligned_leave_i` to another run folder; `--config.init=` trains the same from scratch.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.aligned_peg(
        "random_peg_finetune_i",
        random_hole=presets.RANDOM_HOLE,
        pool=presets.only("I"),
        init="runs/random_peg_aligned_leave_i",
        init_layers="all",
    )

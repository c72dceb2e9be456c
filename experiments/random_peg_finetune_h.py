"""Fine-tuning Exp. XI: HCP-E that never saw type H goes on with type H alone. Preset: fast.

Set `--config.init=runs/random_peg_aligned_leave_h` to another run folder; `--config.init=` trains the same from scratch.
"""

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.aligned_peg(
        "random_peg_finetune_h",
        random_hole=presets.RANDOM_HOLE,
        pool=presets.only("H"),
        init="runs/random_peg_aligned_leave_h",
        init_layers="all",
    )

"""What each change from `paper` to `fast` is worth: the reacher of Exp. I with `fast`, and with one change at a time undone.

`python -m hcp_jax.sweep experiments/ddpg_ablations.py --summary results/ablations/ddpg.json`
"""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config, DDPGConfig

PAPER = DDPGConfig()
CHANGES = {
    "fast": {},
    "without_layer_norm": {"layer_norm": PAPER.layer_norm},
    "without_normalized_inputs": {"normalize_inputs": PAPER.normalize_inputs},
    "with_the_papers_learning_rates": {
        "actor_learning_rate": PAPER.actor_learning_rate,
        "critic_learning_rate": PAPER.critic_learning_rate,
    },
    "without_stop_at_success": {"stop_at_success": PAPER.stop_at_success},
    "without_learning_rate_decay": {"learning_rate_decay": PAPER.learning_rate_decay},
    "with_the_papers_batch_size": presets.SMALL_BATCHES,
    "without_failing_share": {"failing_share": PAPER.failing_share},
}


def get_configs() -> list[Config]:
    return [
        presets.arm(
            f"reacher_{name}",
            "reacher",
            "chain_fk",
            left_out="H",
            total_env_steps=1_536_000,
            ddpg=dataclasses.replace(presets.FAST_DDPG, **change),
        )
        for name, change in CHANGES.items()
    ]

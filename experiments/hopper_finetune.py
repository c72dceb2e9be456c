"""Transfer to 100 new hoppers (paper, figure 4b): hidden layers from an HCP-I run, new embeddings. Preset: fast.

Set `--config.init=runs/hopper_hcpi` to another run folder, or `--config.init=` for the same from scratch.
"""

from hcp_jax import presets
from hcp_jax.config import Config, PoolConfig


def get_config() -> Config:
    return presets.hopper(
        "hopper_finetune",
        encoding="embedding",
        total_env_steps=6_400_000,
        eval_every=320_000,
        num_envs=1000,
        init="runs/hopper_hcpi",
        pool=PoolConfig(num_robots=100, split="new"),
        embedding=presets.IDENTIFIED_EMBEDDING,
    )

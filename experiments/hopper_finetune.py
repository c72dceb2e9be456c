"""Transfer to 100 new hoppers (paper, figure 4b): hidden layers from an HCP-I run, new embeddings. Preset: fast.

Set `--config.init=runs/hopper_hcpi` to another run folder; `--config.init_layers=all` takes the output layers too.
`--config.init= --config.embedding.identify_steps=1_280_000` trains the same from scratch: without a forward model to
start from, identification takes longer.
"""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config, PoolConfig


def get_config() -> Config:
    return presets.hopper(
        "hopper_finetune",
        encoding="embedding",
        total_env_steps=12_800_000,
        eval_every=320_000,
        num_envs=1000,
        ppo=dataclasses.replace(presets.FAST_PPO, learning_rate=6e-4),
        init="runs/hopper_hcpi",
        pool=PoolConfig(num_robots=100, split="new"),
        embedding=dataclasses.replace(presets.IDENTIFIED_EMBEDDING, identify_steps=160_000, fit_steps=0),
    )

"""Exp. I with 10 to 1,440 training arms of each type, at equal steps: what more robots bring to robots never seen (not in the
paper). 1,440 of each of eight types are as many arms as the run has episodes. Preset: fast with small batches, aligned joints.

`python -m hcp_jax.sweep experiments/pool_sizes.py --out runs/arms`, then `collect runs/arms --out results`, and for each
`evaluate results/policies/NAME_s0 --without-robots --json results/arms/pool_sizes/NAME_s0.json`, which `report` shows.
"""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config

ROBOTS_PER_TYPE = (10, 40, 140, 560, 1440)


def get_configs() -> list[Config]:
    config = presets.quick_reacher("reacher_pool", left_out="H", total_env_steps=2_304_000)
    return [
        dataclasses.replace(
            config,
            name=f"reacher_pool_{number}",
            pool=dataclasses.replace(config.pool, robots_per_type=number, heldout_per_type=100),
        )
        for number in ROBOTS_PER_TYPE
    ]

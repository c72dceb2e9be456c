"""The catalogue's Sawyer alone, its masses and joint dynamics randomised: policy C of the paper's test on a real Sawyer (figure
"Testing distance distribution on a real sawyer robot"). Preset: fast with small batches.

It sees the joint poses that Exp. I's policy sees, of this one arm. Without them it is at 0 % after 1.28 M steps
(`results/ablations/runs/reacher_sawyer_no_poses_s0`).
"""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm(
        "reacher_sawyer",
        "reacher",
        "chain_fk",
        robot="sawyer",
        pool=presets.one_arm(robots_per_type=100),
        total_env_steps=1_280_000,
        eval_every=128_000,
        ddpg=dataclasses.replace(presets.FAST_DDPG, **presets.SMALL_BATCHES),
    )

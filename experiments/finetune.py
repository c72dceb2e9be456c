"""One arm, from a policy that was trained on a pool of others: all its layers, on the reacher. Preset: fast, smaller steps.

`--config.robot=FILE` names your arm, a URDF or MJCF file or one of the catalogue; `--config.init=FOLDER` the run or policy to
start from, whose v_h `--config.encoding` must be. `--config.pool.robots_per_type=100` trains on variants of the arm whose
masses and joint dynamics are drawn from `pool.ranges`.
"""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import Config


def get_config() -> Config:
    return presets.arm(
        "finetune",
        "reacher",
        "chain_fk+jacobian+dynamics",
        robot="panda",
        pool=presets.one_arm(robots_per_type=1),
        init="results/policies/reacher_chains_s0",
        init_layers="all",
        total_env_steps=256_000,
        eval_every=64_000,
        ddpg=dataclasses.replace(
            presets.FAST_DDPG,
            **presets.SMALL_BATCHES,
            actor_learning_rate=3e-4,
            critic_learning_rate=3e-4,
            warmup_episodes=0,
            actor_average=0.8,  # 5 iterations: at 0.97 the actor that it started from is half of the mean after 23
        ),
    )

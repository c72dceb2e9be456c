"""One arm, from a policy that was trained on a pool of others: all its layers, on the reacher. Preset: fast, smaller steps.

`--config.robot=FILE` names your arm, a URDF or MJCF file or one of the catalogue; `--config.init=FOLDER` the run or policy to
start from, whose v_h `--config.encoding` must be. `--config.pool.robots_per_type=100` trains on variants of the arm whose
masses and joint dynamics are drawn from `pool.ranges`.
"""

import dataclasses

from hcp_jax import presets
from hcp_jax.config import ArmPoolConfig, Config
from hcp_jax.hardware.ranges import ArmRanges


def get_config() -> Config:
    ranges = ArmRanges(mass_ratio=(0.8, 1.25), damping=(0.1, 5.0), frictionloss=(0.0, 2.0), armature=(0.01, 0.5))
    return presets.arm(
        "finetune",
        "reacher",
        "chain_fk+jacobian+dynamics",
        robot="panda",
        pool=ArmPoolConfig(types=(), left_out=(), robots_per_type=1, heldout_per_type=100, ranges=ranges),
        init="results/policies/reacher_chains_s0",
        init_layers="all",
        total_env_steps=1_280_000,
        eval_every=128_000,
        ddpg=dataclasses.replace(
            presets.FAST_DDPG,
            **presets.SMALL_BATCHES,
            actor_learning_rate=3e-4,
            critic_learning_rate=3e-4,
            warmup_episodes=0,
            actor_average=0.8,  # 5 iterations: at 0.97 the actor that it started from is half of the mean after 23
        ),
    )

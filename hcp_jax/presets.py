"""Named settings that experiments are built from. `paper` is what the dataclasses default to; `fast` is tuned for this code."""

import dataclasses

from hcp_jax.config import (
    ArmConfig,
    ArmPoolConfig,
    Config,
    DDPGConfig,
    EmbeddingConfig,
    HopperConfig,
    HopperPoolConfig,
    PPOConfig,
)
from hcp_jax.hardware.ranges import ArmRanges, nominal_lengths

# Many environments, short unrolls: one environment per robot, 32 steps each. Rewards are scaled so that value targets are
# of order 1, observations are whitened, the step size decays, and physics is integrated by Euler at 2 ms instead of RK4
# (about 3 times faster). The horizon is 200 steps instead of 100: at gamma 0.99 what PPO learned hung on its seed (returns of
# 1,300 and 2,900 after 10 M steps; at 0.995 2,200 and 2,000 after 8 M), and kinematics + dynamics reached 3,300 in 20 M steps
# where it now reaches 4,200 in 5 M.
FAST_PPO = PPOConfig(
    preset="fast",
    unroll_length=32,
    num_epochs=5,
    num_minibatches=32,
    learning_rate=3e-4,
    final_learning_rate=3e-5,
    gamma=0.995,
    value_clip_eps=0.0,
    entropy_cost=0.0,
    normalize_observation=True,
    reward_scale=0.05,
)
FAST_HOPPER = HopperConfig(integrator="euler")
# HCP-I that identifies its robots first (2,000 steps of each): a narrow v_h from a forward model, standardised and still
# from then on. The paper's plain form (32 wide, from the gradients of policy and value loss, drifting under the policy) is
# `EmbeddingConfig()`.
IDENTIFIED_EMBEDDING = EmbeddingConfig(size=8, learning_rate=5e-3, identify_steps=2_000_000)
# The paper's run: 8 environments, whole episodes, RK4.
PAPER_NUM_ENVS = 8


def hopper(name: str, encoding: str, **changes) -> Config:
    """A hopper experiment with the `fast` preset. `changes` are fields of `Config`."""
    return dataclasses.replace(Config(name=name, encoding=encoding, ppo=FAST_PPO, env=FAST_HOPPER), **changes)


def hopper_finetune(name: str, learning_rate: float, identify_steps: int, **changes) -> Config:
    """HCP-I on 100 hoppers that no other experiment has. `changes` are fields of `Config`."""
    config = hopper(
        name,
        "embedding",
        total_env_steps=12_800_000,
        eval_every=320_000,
        num_envs=1000,
        ppo=dataclasses.replace(FAST_PPO, learning_rate=learning_rate),
        pool=HopperPoolConfig(num_robots=100, split="new"),
        embedding=dataclasses.replace(IDENTIFIED_EMBEDDING, identify_steps=identify_steps, fit_steps=0),
    )
    return dataclasses.replace(config, **changes)


def hopper_paper(name: str, encoding: str, **changes) -> Config:
    """A hopper experiment with the `paper` preset."""
    return dataclasses.replace(Config(name=name, encoding=encoding, num_envs=PAPER_NUM_ENVS), **changes)


# 128 episodes, then 160 updates of 1024 steps: a tenth of the paper's steps per episode. LayerNorm and whitened inputs allow
# ten times the step size. What an arm does once it is there would be most of what is learned from, so that is left out.
FAST_DDPG = DDPGConfig(
    preset="fast",
    layer_norm=True,
    normalize_inputs=True,
    actor_learning_rate=1e-3,
    critic_learning_rate=1e-3,
    learning_rate_decay=0.1,
    batch_size=1024,
    updates_per_iteration=160,
    tau=0.02,
    failing_share=0.3,
    stop_at_success=True,
    actor_average=0.97,
)
# The peg: exploration that keeps its direction for some steps gets it to the hole, half of the goals stay the hole itself, and
# those of hindsight are the states that came nearest to it. Arms that jam or hover over the hole are overrated by the critic:
# five-step returns and more episodes of the arms that fail tell it. In the first half, being overrated is what makes it try.
FAST_PEG_DDPG = dataclasses.replace(
    FAST_DDPG,
    actor_learning_rate=3e-4,
    n_step=5,
    n_step_from=0.5,
    buffer_episodes=10_000,
    future_k=1,
    future_candidates=4,
    failing_share=0.5,
    stop_at_success=False,
    actor_average=0.95,
    exploration_noise=0.2,
    exploration_correlation=0.9,
    random_action_probability=0.2,
)
# As many samples in the paper's small batches, which a CPU core works through as fast: the training types are learned in fewer
# steps, but on the peg policies carry over to other types less well (docs/ablations.md).
SMALL_BATCHES = {"batch_size": 128, "updates_per_iteration": 1280, "tau": 0.01}
FAST_NUM_ENVS = 128
# Steps and evaluations of a training, by task. The peg is learned from a reverse curriculum: three episodes in ten start in
# the hole or above it.
ARM_SCHEDULES = {
    "reacher": {"total_env_steps": 5_120_000, "eval_every": 256_000, "ddpg": FAST_DDPG},
    "peg_insertion": {"total_env_steps": 7_680_000, "eval_every": 512_000, "ddpg": FAST_PEG_DDPG},
}
APPROACH_STARTS = {"reacher": 0.0, "peg_insertion": 0.3}
ARM_TYPES = tuple("ABCDEFGHI")
RANDOM_HOLE = 0.2  # [m] side of the cube of hole positions (paper, appendix, "Goal distributions")


def only(robot_type: str, **changes) -> ArmPoolConfig:
    """A pool of one arm type, evaluated on 100 held-out robots as the paper's curves are. `changes` are fields of the pool."""
    return ArmPoolConfig(**{"types": (robot_type,), "left_out": (), "heldout_per_type": 100} | changes)


def one_arm(robots_per_type: int) -> ArmPoolConfig:
    """Variants of `Config.robot`: itself if there is one, else masses and joint dynamics are drawn around a real arm's."""
    ranges = ArmRanges(mass_ratio=(0.8, 1.25), damping=(0.1, 5.0), frictionloss=(0.0, 2.0), armature=(0.01, 0.5))
    return ArmPoolConfig(types=(), left_out=(), robots_per_type=robots_per_type, heldout_per_type=100, ranges=ranges)


def only_dynamics(**ranges) -> ArmPoolConfig:
    """100 arms of type I with nominal links (paper, appendix, "Effect of Dynamics"). `ranges` are fields of `ArmRanges`."""
    return only("I", robots_per_type=100, ranges=dataclasses.replace(nominal_lengths(ArmRanges()), **ranges))


def arm(
    name: str, task: str, encoding: str, left_out: str = "", random_hole: float = 0.0, joint_slots: str = "packed", **changes
) -> Config:
    """An arm experiment with the `fast` preset that trains on types A to I without those in `left_out`.

    `changes` are fields of `Config`.
    """
    config = Config(
        name=name,
        task=task,
        algorithm="ddpg",
        encoding=encoding,
        num_envs=FAST_NUM_ENVS,
        pool=ArmPoolConfig(types=tuple(t for t in ARM_TYPES if t not in left_out), left_out=tuple(left_out)),
        env=ArmConfig(random_hole=random_hole, approach_starts=APPROACH_STARTS[task], joint_slots=joint_slots),
        **ARM_SCHEDULES[task],
    )
    return dataclasses.replace(config, **changes)


def type_i(name: str, task: str, encoding: str, pool: ArmPoolConfig, **changes) -> Config:
    """An arm experiment on type I alone (paper, appendix), which is learned in fewer steps than eight types. Carrying over to
    others does not count here, so batches are small. `changes` are fields of `Config`."""
    schedules = {
        "reacher": {
            "total_env_steps": 1_280_000,
            "eval_every": 128_000,
            "ddpg": dataclasses.replace(FAST_DDPG, **SMALL_BATCHES),
        },
        "peg_insertion": {
            "total_env_steps": 2_560_000,
            "eval_every": 128_000,
            "ddpg": dataclasses.replace(FAST_PEG_DDPG, **SMALL_BATCHES),
        },
    }
    return arm(name, task, encoding, pool=pool, **(schedules[task] | changes))


def quick_reacher(name: str, left_out: str, **changes) -> Config:
    """The reacher with `chain_fk`, aligned joints and small batches. `changes` are fields of `Config`."""
    schedule = {
        "total_env_steps": 3_072_000,
        "eval_every": 384_000,
        "ddpg": dataclasses.replace(FAST_DDPG, **SMALL_BATCHES),
    }
    return arm(name, "reacher", "chain_fk", left_out=left_out, joint_slots="aligned", **(schedule | changes))


def film_reacher(name: str, left_out: str, **changes) -> Config:
    """`quick_reacher` with FiLM. `changes` are fields of `Config`."""
    config = quick_reacher(name, left_out, **changes)
    return dataclasses.replace(config, ddpg=dataclasses.replace(config.ddpg, network="film"))


def aligned_peg(name: str, **changes) -> Config:
    """HCP-E on the peg: Jacobians and aligned joints. `changes` are those of `arm`."""
    return arm(name, "peg_insertion", "chain_fk+jacobian", joint_slots="aligned", **changes)


def film_peg(name: str, **changes) -> Config:
    """`aligned_peg` with FiLM. On types that it was not trained on, an actor is far worse than the mean of itself over many
    iterations, and that of 20 worse than that of 70 (docs/ablations.md)."""
    return aligned_peg(name, ddpg=dataclasses.replace(FAST_PEG_DDPG, network="film", actor_average=0.985), **changes)


def scratch_peg(name: str, robot_type: str, network: str = "flat", ddpg: DDPGConfig = FAST_PEG_DDPG, **changes) -> Config:
    """Peg insertion into a random hole with arms of one type alone, from the start. `changes` are those of `arm`."""
    schedule = {"total_env_steps": 3_840_000, "eval_every": 128_000, "ddpg": dataclasses.replace(ddpg, network=network)}
    return aligned_peg(name, **({"random_hole": RANDOM_HOLE, "pool": only(robot_type)} | schedule | changes))


def finetune_peg(name: str, robot_type: str, init: str, network: str = "flat") -> Config:
    """`scratch_peg` from the policy in folder `init`: a third of its steps, smaller updates, five-step returns throughout."""
    ddpg = dataclasses.replace(
        FAST_PEG_DDPG,
        actor_learning_rate=1e-4,
        critic_learning_rate=3e-4,
        warmup_episodes=0,
        n_step_from=0.0,  # it need not be tempted to try: it knows where to go
    )
    return scratch_peg(name, robot_type, network, ddpg, total_env_steps=1_280_000, init=init, init_layers="all")

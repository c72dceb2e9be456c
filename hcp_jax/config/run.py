"""Settings of one training run, all of them."""

import dataclasses

from hcp_jax.config.arm import ARM_CONDITIONINGS, OWN_ARM_CONDITIONINGS, ArmConfig, ArmPoolConfig
from hcp_jax.config.checks import MAX_SEED, ConfigError, require
from hcp_jax.config.ddpg import DDPGConfig
from hcp_jax.config.embedding import EmbeddingConfig
from hcp_jax.config.hopper import HopperConfig, HopperPoolConfig
from hcp_jax.config.ppo import PPOConfig
from hcp_jax.hardware.arm import CHAIN_TYPES, OTHER_ARMS
from hcp_jax.hardware.encodings import ENCODINGS
from hcp_jax.physics.base import PHYSICS

TASKS = ("hopper", "reacher", "peg_insertion")
ALGORITHM_OF = {"hopper": "ppo", "reacher": "ddpg", "peg_insertion": "ddpg"}
INIT_LAYERS = ("hidden", "all")


@dataclasses.dataclass(frozen=True)
class Config:
    """One training run.

    Attributes:
        name: default run folder, `runs/NAME`.
        task: `hopper`, `reacher` or `peg_insertion`.
        algorithm: `ppo` for the hopper, `ddpg` for the arms.
        seed: seed of initialisation and training. Evaluations have the same episodes whatever it is.
        total_env_steps: control steps over all environments; rounded up to whole iterations.
        num_envs: parallel environments; 0 stands for the number of training robots.
        physics: `auto`, `mjx-warp`, `mjx-jax` or `native`.
        encoding: v_h. Hopper: `none`, `kinematics`, `kinematics+dynamics`, `random` or `embedding`; arms: `none`, `chain`,
            `chain_fk`, `chain_fk+jacobian`, `chain_fk+jacobian+dynamics`, `dynamics`, `chain+dynamics`, `random`, `embedding`,
            `none+end_effector` or `none+goal_offset`.
        eval_every: control steps between evaluations, which also write a checkpoint; rounded to whole iterations.
        eval_robots: hoppers of the training pool, and as many held-out ones, in an evaluation; at most as many of each as the
            smaller pool has.
        keep_checkpoints: newest checkpoints kept beside the best one.
        max_skipped_updates: updates in a row whose loss or gradient is not finite, and which are skipped, that end the run.
        init: run folder whose layers and observation statistics this run starts from; empty starts from scratch.
        init_layers: `hidden` (paper, section 5.2) or `all` of that run's layers.
        robot: one arm to train on instead of types: a URDF or MJCF file, or a name of `robots/catalogue/`.
        robot_base, robot_tip: links that it starts and ends at, where that is not plain (`hcp_jax.robot check --base --tip`).
    """

    name: str
    task: str = "hopper"
    algorithm: str = "ppo"
    seed: int = 0
    total_env_steps: int = 20_000_000
    num_envs: int = 0
    physics: str = "auto"
    encoding: str = "none"
    eval_every: int = 2_000_000
    eval_robots: int = 100
    keep_checkpoints: int = 3
    max_skipped_updates: int = 100
    init: str = ""
    init_layers: str = "hidden"
    robot: str = ""
    robot_base: str = ""
    robot_tip: str = ""
    pool: HopperPoolConfig | ArmPoolConfig = HopperPoolConfig()
    env: HopperConfig | ArmConfig = HopperConfig()
    ppo: PPOConfig = PPOConfig()
    ddpg: DDPGConfig = DDPGConfig()
    embedding: EmbeddingConfig = EmbeddingConfig()

    def __post_init__(self):
        self._check_values()
        self._check_parts()
        if isinstance(self.pool, ArmPoolConfig):
            self._check_arms(self.pool)
        if self.algorithm == "ppo":
            self._check_ppo()
        else:
            self._check_ddpg()

    def _check_values(self) -> None:
        require(bool(self.name), "name", self.name, "a non-empty name")
        for field, allowed in (
            ("task", TASKS),
            ("physics", PHYSICS),
            ("init_layers", INIT_LAYERS),
            ("algorithm", (ALGORITHM_OF.get(self.task, ""),)),
            ("encoding", (*ENCODINGS, "embedding") if self.task == "hopper" else ARM_CONDITIONINGS),
        ):
            require(getattr(self, field) in allowed, field, getattr(self, field), f"one of {', '.join(allowed)}")
        for field in ("total_env_steps", "eval_every", "eval_robots", "keep_checkpoints", "max_skipped_updates"):
            require(getattr(self, field) >= 1, field, getattr(self, field), "at least 1")
        require(0 <= self.seed <= MAX_SEED, "seed", self.seed, f"0 to {MAX_SEED}")
        require(self.num_envs >= 0, "num_envs", self.num_envs, "at least 0")

    def _check_parts(self) -> None:
        kinds = (HopperPoolConfig, HopperConfig) if self.task == "hopper" else (ArmPoolConfig, ArmConfig)
        for field, kind in zip(("pool", "env"), kinds, strict=True):
            require(isinstance(getattr(self, field), kind), field, getattr(self, field), f"{kind.__name__} for {self.task}")
        for field in ("robot", "robot_base", "robot_tip"):
            require(not getattr(self, field) or self.task != "hopper", field, getattr(self, field), "none for the hopper")

    def _check_arms(self, pool: ArmPoolConfig) -> None:
        if self.robot:
            require(not pool.types, "pool.types", pool.types, f"() beside robot={self.robot!r}")
            require(not pool.left_out, "pool.left_out", pool.left_out, f"() beside robot={self.robot!r}")
            require(pool.split == "train", "pool.split", pool.split, f"'train' beside robot={self.robot!r}")
            allowed = OWN_ARM_CONDITIONINGS
            require(self.encoding in allowed, "encoding", self.encoding, f"one of {', '.join(allowed)}")
        else:
            require(len(pool.types) >= 1, "pool.types", pool.types, "at least 1 type, or an arm's file in robot")
            for field in ("robot_base", "robot_tip"):
                require(not getattr(self, field), field, getattr(self, field), "none without robot")
        unfit, allowed = CHAIN_TYPES, "types A to K for peg_insertion"
        if self.task == "reacher":
            unfit, allowed = OTHER_ARMS, "types A to I, R4 to R7 for the reacher (J, K hold a peg)"
            for field in ("random_hole", "approach_starts"):
                require(getattr(self.env, field) == 0, f"env.{field}", getattr(self.env, field), "0 for the reacher")
        for field in ("types", "left_out"):
            for name in getattr(pool, field):
                require(name not in unfit, f"pool.{field}", name, allowed)

    def _check_ppo(self) -> None:
        batch = self.steps_per_iteration
        if batch % self.ppo.num_minibatches:
            raise ConfigError(
                f"ppo.num_minibatches={self.ppo.num_minibatches}: must divide num_envs * ppo.unroll_length = "
                f"{self.resolved_num_envs} * {self.ppo.unroll_length} = {batch}"
            )
        identify_steps = self.embedding.identify_steps
        if self.encoding == "embedding" and -(-identify_steps // batch) >= self.num_iterations:  # the policy starts after it
            raise ConfigError(
                f"embedding.identify_steps={identify_steps}: must leave an iteration ({batch} steps) of "
                f"total_env_steps={self.total_env_steps}"
            )

    def _check_ddpg(self) -> None:
        require(self.embedding.identify_steps == 0, "embedding.identify_steps", self.embedding.identify_steps, "0 for ddpg")
        if self.ddpg.network == "film":
            require(self.encoding != "none", "encoding", self.encoding, "one with features of the robot for ddpg.network=film")
        if self.ddpg.network == "joints":
            allowed = "chain_fk+jacobian"
            require(self.encoding == allowed, "encoding", self.encoding, f"{allowed} for ddpg.network=joints")
        if self.ddpg.buffer_episodes < self.resolved_num_envs:
            raise ConfigError(
                f"ddpg.buffer_episodes={self.ddpg.buffer_episodes}: must hold one iteration's {self.resolved_num_envs} episodes"
            )

    @property
    def resolved_num_envs(self) -> int:
        return self.num_envs or self.pool.num_robots

    @property
    def num_iterations(self) -> int:
        """Of the run."""
        return -(-self.total_env_steps // self.steps_per_iteration)

    @property
    def steps_per_iteration(self) -> int:
        """Control steps per iteration."""
        steps = self.ppo.unroll_length if self.algorithm == "ppo" else self.env.episode_length
        return self.resolved_num_envs * steps

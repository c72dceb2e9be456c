"""Every setting, as frozen dataclasses that check themselves when built."""

import dataclasses
import difflib
import math
import types
import typing

from hcp_jax.errors import UserError
from hcp_jax.hardware.arm import OTHER_ARMS, TYPES
from hcp_jax.hardware.arm_encodings import ARM_ENCODINGS
from hcp_jax.hardware.encodings import ENCODINGS
from hcp_jax.hardware.ranges import ArmRanges, HopperRanges
from hcp_jax.physics.base import INTEGRATORS, PHYSICS

TASKS = ("hopper", "reacher", "peg_insertion")
ALGORITHM_OF = {"hopper": "ppo", "reacher": "ddpg", "peg_insertion": "ddpg"}
ARM_CONDITIONINGS = (*ARM_ENCODINGS, "chain_fk", "chain_fk+jacobian", "none+end_effector", "none+goal_offset", "embedding")
# Those that do not depend on what other arms are trained on (dynamics are scaled by the pool's ranges).
OWN_ARM_CONDITIONINGS = ("none", "chain", "chain_fk", "chain_fk+jacobian", "none+end_effector", "none+goal_offset")
INIT_LAYERS = ("hidden", "all")
RELABEL_STRATEGIES = ("future", "final", "none")
NETWORKS = ("flat", "joints")


class ConfigError(UserError):
    """A setting is unknown, of the wrong type or outside what is allowed. The message names field, value and bounds."""


def _require(condition: bool, field: str, value: object, allowed: str) -> None:
    if not condition:
        raise ConfigError(f"{field}={value!r}: expected {allowed}")


def _positive(value: float) -> bool:
    return math.isfinite(value) and value > 0


def _at_least_zero(value: float) -> bool:
    return math.isfinite(value) and value >= 0


@dataclasses.dataclass(frozen=True)
class PoolConfig:
    """The robots. A pool depends on this record alone, never on the training seed.

    Attributes:
        num_robots: training robots (paper: 1000).
        num_heldout: robots that are never trained on, for evaluation.
        seed: seed of the robots' hardware.
        split: `train`, or `new` for robots that no other pool of this seed contains (fine-tuning).
        ranges: where the hardware is drawn from.
    """

    num_robots: int = 1000
    num_heldout: int = 100
    seed: int = 0
    split: str = "train"
    ranges: HopperRanges = HopperRanges()

    def __post_init__(self):
        _require(self.num_robots >= 1, "pool.num_robots", self.num_robots, "at least 1")
        _require(self.num_heldout >= 1, "pool.num_heldout", self.num_heldout, "at least 1")
        _require(self.split in ("train", "new"), "pool.split", self.split, "'train' or 'new'")


@dataclasses.dataclass(frozen=True)
class ArmPoolConfig:
    """The arms. A pool depends on this record alone, never on the training seed.

    Attributes:
        types: robot types to train on (hcp_jax.hardware.arm); none where `robot` names an arm.
        left_out: types to evaluate zero-shot.
        robots_per_type: training robots of each type (paper: 140). Of an arm from a file: 1 is the arm as it is, more are
            variants of it whose masses and joint dynamics are drawn from `ranges`.
        heldout_per_type: robots of each type, also of those left out, that are never trained on. Of an arm from a file:
            episodes of it in an evaluation.
        seed: seed of the robots' hardware.
        split: `train`, or `new` for robots that no other pool of this seed contains (fine-tuning).
        ranges: where the hardware is drawn from.
    """

    types: tuple[str, ...] = tuple("ABCDEFGI")
    left_out: tuple[str, ...] = ("H",)
    robots_per_type: int = 140
    heldout_per_type: int = 25
    seed: int = 0
    split: str = "train"
    ranges: ArmRanges = ArmRanges()

    def __post_init__(self):
        for field in ("types", "left_out"):
            value = getattr(self, field)
            for name in value:
                _require(name in TYPES, f"pool.{field}", name, f"types out of {', '.join(TYPES)}")
            _require(len(set(value)) == len(value), f"pool.{field}", value, "no type twice")
        for field in ("robots_per_type", "heldout_per_type"):
            _require(getattr(self, field) >= 1, f"pool.{field}", getattr(self, field), "at least 1")
        _require(self.split in ("train", "new"), "pool.split", self.split, "'train' or 'new'")

    @property
    def num_robots(self) -> int:
        return max(1, len(self.types)) * self.robots_per_type

    @property
    def num_heldout(self) -> int:
        return max(1, len({*self.types, *self.left_out})) * self.heldout_per_type


@dataclasses.dataclass(frozen=True)
class HopperConfig:
    """The hopper task.

    Attributes:
        episode_length: control steps per episode (paper: 2048).
        integrator: `rk4` (hopper.json), `euler` or `implicitfast`.
    """

    episode_length: int = 2048
    integrator: str = "rk4"

    def __post_init__(self):
        _require(self.episode_length >= 1, "env.episode_length", self.episode_length, "at least 1")
        _require(self.integrator in INTEGRATORS, "env.integrator", self.integrator, f"one of {', '.join(INTEGRATORS)}")


@dataclasses.dataclass(frozen=True)
class ArmConfig:
    """The arm's tasks.

    Attributes:
        integrator: `rk4` (1 ms, released code), `euler` (1 ms) or `implicitfast` (4 ms).
        random_hole: side of the cube [m] in which the hole is placed (paper: 0.2); 0 keeps it where it is.
        approach_starts: share of the training episodes of peg insertion that start with the peg upright, in the hole or up to
            0.15 m above it (a reverse curriculum, Florensa et al. 2017); evaluation never does.
        episode_length: control steps per episode (paper: 200).
        observation_noise: half-width of the uniform noise on joint angles [rad] and velocities [rad/s].
        success_distance: of the point of interest from the goal [m].
        action_cost: weight of |action|^2 in the reward.
    """

    integrator: str = "implicitfast"
    random_hole: float = 0.0
    approach_starts: float = 0.0
    episode_length: int = 200
    observation_noise: float = 0.02
    success_distance: float = 0.02
    action_cost: float = 0.1

    def __post_init__(self):
        _require(self.integrator in INTEGRATORS, "env.integrator", self.integrator, f"one of {', '.join(INTEGRATORS)}")
        _require(self.episode_length >= 1, "env.episode_length", self.episode_length, "at least 1")
        _require(_positive(self.success_distance), "env.success_distance", self.success_distance, "a number above 0")
        _require(0.0 <= self.approach_starts <= 1.0, "env.approach_starts", self.approach_starts, "a number in [0, 1]")
        for name in ("random_hole", "observation_noise", "action_cost"):
            _require(_at_least_zero(getattr(self, name)), f"env.{name}", getattr(self, name), "a number of at least 0")


@dataclasses.dataclass(frozen=True)
class PPOConfig:
    """PPO. The defaults are the paper's (appendix, table "Hyperparameters for hopper") with 8 environments.

    Attributes:
        preset: name of the set of values that this one started from.
        unroll_length: control steps of each environment between updates (paper: a whole episode, 2048).
        num_epochs: passes over the collected steps.
        num_minibatches: minibatches per pass; must divide num_envs * unroll_length (paper: 8 * 2048 / 512 = 32).
        learning_rate: Adam's step for the networks.
        final_learning_rate: its value at the end of the run, reached linearly.
        gamma, gae_lambda: discount and trace decay per control step.
        clip_eps: clip range of the probability ratio.
        value_clip_eps: clip range of the value's change, in scaled reward; 0 does not clip (released code: 0.2).
        value_cost, entropy_cost: weights of the value loss and the entropy bonus.
        max_grad_norm: bound on the global norm of the networks' gradient (released code: 1).
        hidden_sizes: widths of the hidden layers of policy and value function.
        initial_log_std: of the actions.
        normalize_observation: whiten observations by running statistics (released code: no).
        reward_scale: factor on rewards as the learner sees them.
    """

    preset: str = "paper"
    unroll_length: int = 2048
    num_epochs: int = 5
    num_minibatches: int = 32
    learning_rate: float = 1e-4
    final_learning_rate: float = 1e-4
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_eps: float = 0.2
    value_clip_eps: float = 0.2
    value_cost: float = 0.5
    entropy_cost: float = 0.015
    max_grad_norm: float = 1.0
    hidden_sizes: tuple[int, ...] = (128, 128)
    initial_log_std: float = 0.0
    normalize_observation: bool = False
    reward_scale: float = 1.0

    def __post_init__(self):
        for name in ("unroll_length", "num_epochs", "num_minibatches"):
            _require(getattr(self, name) >= 1, f"ppo.{name}", getattr(self, name), "at least 1")
        for name in ("learning_rate", "clip_eps", "max_grad_norm", "reward_scale"):
            _require(_positive(getattr(self, name)), f"ppo.{name}", getattr(self, name), "a number above 0")
        for name in ("final_learning_rate", "value_clip_eps", "value_cost", "entropy_cost"):
            _require(_at_least_zero(getattr(self, name)), f"ppo.{name}", getattr(self, name), "a number of at least 0")
        for name in ("gamma", "gae_lambda"):
            _require(0.0 <= getattr(self, name) <= 1.0, f"ppo.{name}", getattr(self, name), "a number in [0, 1]")
        _require(
            len(self.hidden_sizes) >= 1 and min(self.hidden_sizes) >= 1,
            "ppo.hidden_sizes",
            self.hidden_sizes,
            "sizes of at least 1",
        )


@dataclasses.dataclass(frozen=True)
class DDPGConfig:
    """DDPG with hindsight experience replay. The defaults are the paper's (appendix, table "Hyperparameters for reacher and peg
    insertion tasks"), exploration and warm-up those of the released code.

    Attributes:
        preset: name of the set of values that this one started from.
        network: `flat`, one vector through one actor and one critic (paper); or `joints`, layers shared by all joints, for the
            encoding `chain_fk+jacobian`.
        hidden_sizes: widths of the hidden layers of actor and critic; the action enters the critic at the second. Of `joints`:
            the first is that of the layers over each joint, the others the critic's after them.
        actor_learning_rate, critic_learning_rate: Adam's steps.
        learning_rate_decay: of all steps: their factor at the end of the run, reached linearly.
        critic_weight_decay: L2 penalty on the critic's kernels.
        gamma: discount per control step.
        n_step: steps whose rewards are summed before the target network's value (paper: 1).
        n_step_from: share of the run after which `n_step` counts; until then it is 1.
        tau: step of the target networks towards the networks, per update.
        batch_size: steps per update.
        buffer_episodes: capacity of the replay buffer (paper: 1e6 steps, 5000 episodes of 200).
        warmup_episodes: random episodes before the first update.
        updates_per_iteration: updates after each iteration's `num_envs` episodes (paper: 100 after every episode).
        relabel: HER's goals: `future`, `final` or `none`.
        future_k: relabelled goals for each original one.
        future_candidates: future states drawn for a relabelled goal, of which the nearest to the episode's own goal is taken.
        failing_share: of the training episodes, whose robots are drawn in proportion to how often they failed lately.
        stop_at_success: learn nothing from what an episode does after it reached its goal.
        actor_average: what a running mean of the actors keeps of itself at each iteration; that mean is what is evaluated
            (0: the actor itself).
        exploration_noise: standard deviation of the Gaussian added to actions.
        exploration_correlation: of that Gaussian from one step to the next (0: white, as the paper's).
        random_action_probability: share of actions that are uniform instead.
        layer_norm: LayerNorm before each SELU.
        normalize_inputs: whiten the networks' inputs by running statistics.
        double_critic: the target takes the smaller value of two critics (Fujimoto et al. 2018).
    """

    preset: str = "paper"
    network: str = "flat"
    hidden_sizes: tuple[int, ...] = (128, 256, 256)
    actor_learning_rate: float = 1e-4
    critic_learning_rate: float = 1e-4
    learning_rate_decay: float = 1.0
    critic_weight_decay: float = 1e-3
    gamma: float = 0.99
    n_step: int = 1
    n_step_from: float = 0.0
    tau: float = 0.01
    batch_size: int = 128
    buffer_episodes: int = 5_000
    warmup_episodes: int = 50
    updates_per_iteration: int = 100
    relabel: str = "future"
    future_k: int = 4
    future_candidates: int = 1
    failing_share: float = 0.0
    stop_at_success: bool = False
    actor_average: float = 0.0
    exploration_noise: float = 0.1
    exploration_correlation: float = 0.0
    random_action_probability: float = 0.1
    layer_norm: bool = False
    normalize_inputs: bool = False
    double_critic: bool = False

    def __post_init__(self):
        for name in ("batch_size", "buffer_episodes", "updates_per_iteration", "future_candidates", "n_step"):
            _require(getattr(self, name) >= 1, f"ddpg.{name}", getattr(self, name), "at least 1")
        for name in ("warmup_episodes", "future_k"):
            _require(getattr(self, name) >= 0, f"ddpg.{name}", getattr(self, name), "at least 0")
        for name in ("actor_learning_rate", "critic_learning_rate"):
            _require(_positive(getattr(self, name)), f"ddpg.{name}", getattr(self, name), "a number above 0")
        for name in ("learning_rate_decay", "critic_weight_decay", "exploration_noise"):
            _require(_at_least_zero(getattr(self, name)), f"ddpg.{name}", getattr(self, name), "a number of at least 0")
        for name in ("gamma", "tau", "random_action_probability", "failing_share", "n_step_from"):
            _require(0.0 <= getattr(self, name) <= 1.0, f"ddpg.{name}", getattr(self, name), "a number in [0, 1]")
        for name in ("actor_average", "exploration_correlation"):
            _require(0.0 <= getattr(self, name) < 1.0, f"ddpg.{name}", getattr(self, name), "a number in [0, 1)")
        _require(self.network in NETWORKS, "ddpg.network", self.network, f"one of {', '.join(NETWORKS)}")
        _require(self.relabel in RELABEL_STRATEGIES, "ddpg.relabel", self.relabel, f"one of {', '.join(RELABEL_STRATEGIES)}")
        sizes = self.hidden_sizes
        _require(len(sizes) >= 2 and min(sizes) >= 1, "ddpg.hidden_sizes", sizes, "at least two sizes of at least 1")


@dataclasses.dataclass(frozen=True)
class EmbeddingConfig:
    """The learned v_h of HCP-I.

    With `identify_steps` at 0, the paper's form, v_h learns from the gradients of policy and value loss. Above 0 a run starts
    by identifying its robots: v_h learns what a forward model needs to predict the next observation, while the policy learns
    without it. v_h is then standardised over the robots and stands still, and the policy starts afresh with it.

    Attributes:
        size: width of v_h (paper: 32).
        initial_scale: standard deviation of its initial values.
        learning_rate: Adam's step for the embedding, decayed like the networks' or to 0 over the identification.
        model_learning_rate: Adam's step for the forward model, decayed to 0 over the identification.
        identify_steps: control steps of identification; rounded to whole iterations.
        fit_steps: control steps of each held-out robot for fitting its v_h at every evaluation, with the networks frozen; 0
            does not fit.
    """

    size: int = 32
    initial_scale: float = 0.05
    learning_rate: float = 1e-3
    model_learning_rate: float = 1e-3
    identify_steps: int = 0
    fit_steps: int = 3_200

    def __post_init__(self):
        _require(self.size >= 1, "embedding.size", self.size, "at least 1")
        for name in ("learning_rate", "model_learning_rate"):
            _require(_positive(getattr(self, name)), f"embedding.{name}", getattr(self, name), "a number above 0")
        for name in ("initial_scale", "identify_steps", "fit_steps"):
            _require(_at_least_zero(getattr(self, name)), f"embedding.{name}", getattr(self, name), "a number of at least 0")


@dataclasses.dataclass(frozen=True)
class Config:
    """One training run.

    Attributes:
        name: default run folder, `runs/NAME`.
        task: `hopper`, `reacher` or `peg_insertion`.
        algorithm: `ppo` for the hopper, `ddpg` for the arms.
        seed: seed of initialisation, training and evaluation noise.
        total_env_steps: control steps over all environments; rounded up to whole iterations.
        num_envs: parallel environments; 0 stands for the number of training robots.
        physics: `auto`, `mjx-warp`, `mjx-jax` or `native`.
        encoding: v_h. Hopper: `none`, `kinematics`, `kinematics+dynamics`, `random` or `embedding`; arms: `none`, `chain`,
            `chain_fk`, `chain_fk+jacobian`, `dynamics`, `chain+dynamics`, `random`, `embedding`, `none+end_effector` or
            `none+goal_offset`.
        eval_every: control steps between evaluations, which also write a checkpoint; rounded to whole iterations.
        eval_robots: hoppers of the training pool, and at most as many held-out ones, in an evaluation.
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
    pool: PoolConfig | ArmPoolConfig = PoolConfig()
    env: HopperConfig | ArmConfig = HopperConfig()
    ppo: PPOConfig = PPOConfig()
    ddpg: DDPGConfig = DDPGConfig()
    embedding: EmbeddingConfig = EmbeddingConfig()

    def __post_init__(self):
        _require(bool(self.name), "name", self.name, "a non-empty name")
        for field, allowed in (
            ("task", TASKS),
            ("physics", PHYSICS),
            ("init_layers", INIT_LAYERS),
            ("algorithm", (ALGORITHM_OF.get(self.task, ""),)),
            ("encoding", (*ENCODINGS, "embedding") if self.task == "hopper" else ARM_CONDITIONINGS),
        ):
            _require(getattr(self, field) in allowed, field, getattr(self, field), f"one of {', '.join(allowed)}")
        for field in ("total_env_steps", "eval_every", "eval_robots", "keep_checkpoints", "max_skipped_updates"):
            _require(getattr(self, field) >= 1, field, getattr(self, field), "at least 1")
        _require(self.seed >= 0, "seed", self.seed, "at least 0")
        _require(self.num_envs >= 0, "num_envs", self.num_envs, "at least 0")
        kinds = (PoolConfig, HopperConfig) if self.task == "hopper" else (ArmPoolConfig, ArmConfig)
        for field, kind in zip(("pool", "env"), kinds, strict=True):
            _require(isinstance(getattr(self, field), kind), field, getattr(self, field), f"{kind.__name__} for {self.task}")
        _require(not self.robot or self.task != "hopper", "robot", self.robot, "none for the hopper")
        if isinstance(self.pool, ArmPoolConfig):
            self._check_robot(self.pool)
        if isinstance(self.pool, ArmPoolConfig) and self.task == "reacher":
            for name in (*self.pool.types, *self.pool.left_out):
                _require(name not in OTHER_ARMS, "pool.types", name, "types A to I for the reacher (J and K hold a peg)")
        if isinstance(self.env, ArmConfig) and self.task == "reacher":
            _require(self.env.approach_starts == 0, "env.approach_starts", self.env.approach_starts, "0 for the reacher")
        if self.algorithm == "ppo":
            self._check_minibatches()
        else:
            self._check_buffer()

    def _check_robot(self, pool: ArmPoolConfig) -> None:
        if not self.robot:
            _require(len(pool.types) >= 1, "pool.types", pool.types, "at least 1 type, or an arm's file in robot")
            return
        _require(not pool.types, "pool.types", pool.types, f"() beside robot={self.robot!r}")
        _require(not pool.left_out, "pool.left_out", pool.left_out, f"() beside robot={self.robot!r}")
        _require(
            self.encoding in OWN_ARM_CONDITIONINGS, "encoding", self.encoding, f"one of {', '.join(OWN_ARM_CONDITIONINGS)}"
        )

    def _check_minibatches(self) -> None:
        batch = self.batch_size
        if batch % self.ppo.num_minibatches:
            raise ConfigError(
                f"ppo.num_minibatches={self.ppo.num_minibatches}: must divide num_envs * ppo.unroll_length = "
                f"{self.resolved_num_envs} * {self.ppo.unroll_length} = {batch}"
            )

    def _check_buffer(self) -> None:
        if self.ddpg.network == "joints":
            _require(
                self.encoding == "chain_fk+jacobian", "encoding", self.encoding, "chain_fk+jacobian for ddpg.network=joints"
            )
        if self.ddpg.buffer_episodes < self.resolved_num_envs:
            raise ConfigError(
                f"ddpg.buffer_episodes={self.ddpg.buffer_episodes}: must hold one iteration's {self.resolved_num_envs} episodes"
            )

    @property
    def resolved_num_envs(self) -> int:
        return self.num_envs or self.pool.num_robots

    @property
    def batch_size(self) -> int:
        """Control steps per iteration."""
        steps = self.ppo.unroll_length if self.algorithm == "ppo" else self.env.episode_length
        return self.resolved_num_envs * steps


def to_dict(config) -> dict:
    """The config as plain nested dictionaries."""
    return dataclasses.asdict(config)


def from_dict(cls, values: dict, path: str = ""):
    """Builds dataclass `cls` from what `to_dict` gave. Raises ConfigError for unknown, missing or ill-typed fields."""
    if not isinstance(values, dict):
        raise ConfigError(f"{path or cls.__name__}={values!r}: expected fields {', '.join(field_names(cls))}")
    hints = typing.get_type_hints(cls)
    arguments = {}
    for name, value in values.items():
        where = f"{path}{name}"
        if name not in hints:
            raise ConfigError(unknown_field(where, [f"{path}{n}" for n in hints]))
        arguments[name] = _convert(hints[name], value, where)
    try:
        return cls(**arguments)
    except TypeError as error:
        raise ConfigError(f"{path or cls.__name__}: {error}") from error


def unknown_field(name: str, known: list[str]) -> str:
    """One line that names the fields nearest to `name`."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known fields: {', '.join(sorted(known))}"
    return f"{name}: no such field; {hint}"


def field_names(config, path: str = "") -> list[str]:
    """Dotted paths of all leaf fields of a dataclass of dataclasses (a class without unions, or an instance)."""
    names = []
    for name, hint in typing.get_type_hints(type(config) if not isinstance(config, type) else config).items():
        part = hint if isinstance(config, type) else getattr(config, name)
        names += field_names(part, f"{path}{name}.") if dataclasses.is_dataclass(part) else [f"{path}{name}"]
    return names


def _convert(hint, value, where: str):
    if isinstance(hint, types.UnionType):
        hint = _choose(typing.get_args(hint), value)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, f"{where}.")
    origin = typing.get_origin(hint)
    if origin is tuple:
        item = typing.get_args(hint)[0]
        if not isinstance(value, (list, tuple)):
            raise ConfigError(f"{where}={value!r}: expected a list of {item.__name__}")
        return tuple(_convert(item, v, where) for v in value)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not hint:
        raise ConfigError(f"{where}={value!r}: expected {hint.__name__}, not {type(value).__name__}")
    return value


def _choose(kinds: tuple[type, ...], value) -> type:
    """The dataclass out of `kinds` that has most of the fields in `value`."""
    fields = set(value) if isinstance(value, dict) else set()
    return max(kinds, key=lambda kind: len(fields & set(typing.get_type_hints(kind))))

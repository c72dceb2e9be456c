"""Every setting, as frozen dataclasses that check themselves when built."""

import dataclasses
import difflib
import math
import typing

from hcp_jax.hardware.encodings import ENCODINGS
from hcp_jax.hardware.ranges import HopperRanges
from hcp_jax.physics.base import INTEGRATORS, PHYSICS

ALGORITHMS = ("ppo",)
TASKS = ("hopper",)


class ConfigError(ValueError):
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
        task: `hopper`.
        algorithm: `ppo`.
        seed: seed of initialisation, training and evaluation noise.
        total_env_steps: control steps over all environments; rounded up to whole iterations.
        num_envs: parallel environments; 0 stands for the number of training robots.
        physics: `auto`, `mjx-warp`, `mjx-jax` or `native`.
        encoding: v_h: `none`, `kinematics`, `kinematics+dynamics`, `random` or `embedding`.
        eval_every: control steps between evaluations, which also write a checkpoint; rounded to whole iterations.
        eval_robots: robots of the training pool, and at most as many held-out ones, in an evaluation.
        keep_checkpoints: newest checkpoints kept beside the best one.
        init: run folder whose hidden layers and observation statistics this run starts from; empty starts from scratch.
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
    init: str = ""
    pool: PoolConfig = PoolConfig()
    env: HopperConfig = HopperConfig()
    ppo: PPOConfig = PPOConfig()
    embedding: EmbeddingConfig = EmbeddingConfig()

    def __post_init__(self):
        _require(bool(self.name), "name", self.name, "a non-empty name")
        for field, allowed in (
            ("task", TASKS),
            ("algorithm", ALGORITHMS),
            ("physics", PHYSICS),
            ("encoding", (*ENCODINGS, "embedding")),
        ):
            _require(getattr(self, field) in allowed, field, getattr(self, field), f"one of {', '.join(allowed)}")
        for field in ("total_env_steps", "eval_every", "eval_robots", "keep_checkpoints"):
            _require(getattr(self, field) >= 1, field, getattr(self, field), "at least 1")
        _require(self.seed >= 0, "seed", self.seed, "at least 0")
        _require(self.num_envs >= 0, "num_envs", self.num_envs, "at least 0")
        batch = self.batch_size
        if batch % self.ppo.num_minibatches:
            raise ConfigError(
                f"ppo.num_minibatches={self.ppo.num_minibatches}: must divide num_envs * ppo.unroll_length = "
                f"{self.resolved_num_envs} * {self.ppo.unroll_length} = {batch}"
            )

    @property
    def resolved_num_envs(self) -> int:
        return self.num_envs or self.pool.num_robots

    @property
    def batch_size(self) -> int:
        """Control steps per iteration."""
        return self.resolved_num_envs * self.ppo.unroll_length


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


def field_names(cls, path: str = "") -> list[str]:
    """Dotted paths of all leaf fields of a dataclass of dataclasses."""
    names = []
    for name, hint in typing.get_type_hints(cls).items():
        names += field_names(hint, f"{path}{name}.") if dataclasses.is_dataclass(hint) else [f"{path}{name}"]
    return names


def _convert(hint, value, where: str):
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

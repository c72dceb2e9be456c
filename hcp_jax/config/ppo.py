"""Settings of PPO."""

import dataclasses
import math

from hcp_jax.config.checks import is_at_least_zero, is_positive, require


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
            require(getattr(self, name) >= 1, f"ppo.{name}", getattr(self, name), "at least 1")
        for name in ("learning_rate", "clip_eps", "max_grad_norm", "reward_scale"):
            require(is_positive(getattr(self, name)), f"ppo.{name}", getattr(self, name), "a number above 0")
        for name in ("final_learning_rate", "value_clip_eps", "value_cost", "entropy_cost"):
            require(is_at_least_zero(getattr(self, name)), f"ppo.{name}", getattr(self, name), "a number of at least 0")
        require(math.isfinite(self.initial_log_std), "ppo.initial_log_std", self.initial_log_std, "a finite number")
        for name in ("gamma", "gae_lambda"):
            require(0.0 <= getattr(self, name) <= 1.0, f"ppo.{name}", getattr(self, name), "a number in [0, 1]")
        require(
            len(self.hidden_sizes) >= 1 and min(self.hidden_sizes) >= 1,
            "ppo.hidden_sizes",
            self.hidden_sizes,
            "sizes of at least 1",
        )

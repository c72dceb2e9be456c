"""Settings of DDPG with hindsight experience replay."""

import dataclasses

from hcp_jax.config.checks import is_at_least_zero, is_positive, require

RELABEL_STRATEGIES = ("future", "final", "none")
NETWORKS = ("flat", "film", "joints")


@dataclasses.dataclass(frozen=True)
class DDPGConfig:
    """DDPG with hindsight experience replay. The defaults are the paper's (appendix, table "Hyperparameters for reacher and peg
    insertion tasks"), exploration and warm-up those of the released code.

    Attributes:
        preset: name of the set of values that this one started from.
        network: `flat`, one vector through one actor and one critic (paper); `film`, the same, where v_h also scales and
            shifts the hidden layers; or `joints`, layers shared by all joints, for the encoding `chain_fk+jacobian`.
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
            require(getattr(self, name) >= 1, f"ddpg.{name}", getattr(self, name), "at least 1")
        for name in ("warmup_episodes", "future_k"):
            require(getattr(self, name) >= 0, f"ddpg.{name}", getattr(self, name), "at least 0")
        for name in ("actor_learning_rate", "critic_learning_rate"):
            require(is_positive(getattr(self, name)), f"ddpg.{name}", getattr(self, name), "a number above 0")
        for name in ("learning_rate_decay", "critic_weight_decay", "exploration_noise"):
            require(is_at_least_zero(getattr(self, name)), f"ddpg.{name}", getattr(self, name), "a number of at least 0")
        for name in ("gamma", "tau", "random_action_probability", "failing_share", "n_step_from"):
            require(0.0 <= getattr(self, name) <= 1.0, f"ddpg.{name}", getattr(self, name), "a number in [0, 1]")
        for name in ("actor_average", "exploration_correlation"):
            require(0.0 <= getattr(self, name) < 1.0, f"ddpg.{name}", getattr(self, name), "a number in [0, 1)")
        require(self.network in NETWORKS, "ddpg.network", self.network, f"one of {', '.join(NETWORKS)}")
        require(self.relabel in RELABEL_STRATEGIES, "ddpg.relabel", self.relabel, f"one of {', '.join(RELABEL_STRATEGIES)}")
        sizes = self.hidden_sizes
        require(len(sizes) >= 2 and min(sizes) >= 1, "ddpg.hidden_sizes", sizes, "at least two sizes of at least 1")

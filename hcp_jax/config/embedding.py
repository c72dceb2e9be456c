"""Settings of the learned v_h."""

import dataclasses

from hcp_jax.config.checks import is_at_least_zero, is_positive, require


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
        fit_steps: control steps of each held-out robot (hopper) for fitting its v_h at every evaluation, with the networks
            frozen; 0 does not fit.
    """

    size: int = 32
    initial_scale: float = 0.05
    learning_rate: float = 1e-3
    model_learning_rate: float = 1e-3
    identify_steps: int = 0
    fit_steps: int = 3_200

    def __post_init__(self):
        require(self.size >= 1, "embedding.size", self.size, "at least 1")
        for name in ("learning_rate", "model_learning_rate"):
            require(is_positive(getattr(self, name)), f"embedding.{name}", getattr(self, name), "a number above 0")
        for name in ("initial_scale", "identify_steps", "fit_steps"):
            require(is_at_least_zero(getattr(self, name)), f"embedding.{name}", getattr(self, name), "a number of at least 0")

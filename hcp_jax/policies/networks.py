"""The networks of PPO: policy mean, value, and the forward model that grounds a learned hardware embedding."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from flax import linen as nn


class MLP(nn.Module):
    """SELU layers of `hidden_sizes`, then a linear layer of `output_size` (paper, appendix "Hopper")."""

    hidden_sizes: Sequence[int]
    output_size: int
    output_scale: float = 1.0

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        for i, size in enumerate(self.hidden_sizes):
            x = nn.selu(nn.Dense(size, name=f"hidden_{i}")(x))
        init = nn.initializers.variance_scaling(self.output_scale**2, "fan_in", "truncated_normal")
        return nn.Dense(self.output_size, kernel_init=init, name="output")(x)


class ActorCritic(nn.Module):
    """Two MLPs on `obs` concatenated with v_h (paper, section 3.3), a log std, and optionally a forward model.

    Methods take obs [..., O], normalised, and v_h [..., K].
    """

    action_size: int
    observation_size: int
    hidden_sizes: Sequence[int]
    initial_log_std: float
    with_forward_model: bool = False

    def setup(self):
        self.policy = MLP(self.hidden_sizes, self.action_size, output_scale=0.01)
        self.value_function = MLP(self.hidden_sizes, 1)
        self.log_std = self.param("log_std", nn.initializers.constant(self.initial_log_std), (self.action_size,))
        if self.with_forward_model:
            self.forward_model = MLP(self.hidden_sizes, self.observation_size)

    def act(self, obs: jax.Array, v_h: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Mean [..., A] and log std [A] of the action."""
        return self.policy(jnp.concatenate([obs, v_h], axis=-1)), self.log_std

    def value(self, obs: jax.Array, v_h: jax.Array) -> jax.Array:
        """Expected scaled return: [...]."""
        return self.value_function(jnp.concatenate([obs, v_h], axis=-1))[..., 0]

    def predict(self, obs: jax.Array, action: jax.Array, v_h: jax.Array) -> jax.Array:
        """Expected change of the observation in one control step, in units of its standard deviation: [..., O]."""
        return self.forward_model(jnp.concatenate([obs, action, v_h], axis=-1))

    def __call__(self, obs: jax.Array, action: jax.Array, v_h: jax.Array):
        """Touches every parameter; used for initialisation alone."""
        predicted = self.predict(obs, action, v_h) if self.with_forward_model else None
        return self.act(obs, v_h), self.value(obs, v_h), predicted

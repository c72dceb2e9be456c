"""The networks: of PPO, with the forward model that grounds a learned hardware embedding, and of DDPG."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from flax import linen as nn

from hcp_jax.policies.goal_conditioning import split_joints


class MLP(nn.Module):
    """SELU layers of `hidden_sizes`, then a linear layer of `output_size` (paper, appendix "Hopper")."""

    hidden_sizes: Sequence[int]
    output_size: int
    output_scale: float = 1.0

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        for i, size in enumerate(self.hidden_sizes):
            x = selu(nn.Dense(size, name=f"hidden_{i}")(x))
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


SELU_ALPHA, SELU_SCALE = 1.6732632423543772, 1.0507009873554805
FILM_SIZE = 64  # numbers in which a network with FiLM sums up v_h


class DeterministicActor(nn.Module):
    """Actions in (-1, 1) from one vector: SELU layers, then tanh (paper, appendix, "Hyperparameters").

    Where `film_from` is not None, inputs from there on are v_h and what follows from it, and also scale and shift the hidden
    layers after the first one (FiLM, Perez et al. 2018).
    """

    hidden_sizes: Sequence[int]
    action_size: int
    layer_norm: bool = False
    film_from: int | None = None

    @nn.compact
    def __call__(self, inputs: jax.Array) -> jax.Array:
        x, summary = inputs, summarize_v_h(inputs, self.film_from, self.layer_norm)
        for i, size in enumerate(self.hidden_sizes):
            x = selu_layer(x, size, f"hidden_{i}", self.layer_norm, summary if i else None)
        init = nn.initializers.variance_scaling(1e-4, "fan_in", "truncated_normal")
        return jnp.tanh(nn.Dense(self.action_size, kernel_init=init, name="output")(x))


class Critic(nn.Module):
    """Action values: SELU layers, the action added at the second one (paper, appendix, "Hyperparameters"): [...].

    `film_from` is that of `DeterministicActor`.
    """

    hidden_sizes: Sequence[int]
    layer_norm: bool = False
    film_from: int | None = None

    @nn.compact
    def __call__(self, inputs: jax.Array, action: jax.Array) -> jax.Array:
        x, summary = inputs, summarize_v_h(inputs, self.film_from, self.layer_norm)
        for i, size in enumerate(self.hidden_sizes):
            x = jnp.concatenate([x, action], axis=-1) if i == 1 else x
            x = selu_layer(x, size, f"hidden_{i}", self.layer_norm, summary if i else None)
        init = nn.initializers.variance_scaling(1e-4, "fan_in", "truncated_normal")
        return nn.Dense(1, kernel_init=init, name="output")(x)[..., 0]


def selu(x: jax.Array) -> jax.Array:
    """SELU (Klambauer et al. 2017): [...]. By exp, not expm1 as `nn.selu`, which takes twice as long on a CPU and is more exact
    than networks need."""
    return SELU_SCALE * jnp.where(x > 0, x, SELU_ALPHA * (jnp.exp(jnp.where(x > 0, 0.0, x)) - 1.0))


def selu_layer(x: jax.Array, size: int, name: str, layer_norm: bool, summary: jax.Array | None = None) -> jax.Array:
    """A dense layer with SELU. Call inside a compact module.

    Args:
        layer_norm: LayerNorm without scale and bias before SELU.
        summary: [..., FILM_SIZE], a linear function of which scales and shifts what SELU gets; at first not at all.
    """
    x = nn.Dense(size, name=name)(x)
    x = nn.LayerNorm(use_scale=False, use_bias=False, name=f"{name}_norm")(x) if layer_norm else x
    if summary is not None:
        film = nn.Dense(2 * size, kernel_init=nn.initializers.zeros, name=f"{name}_film")(summary)
        scale, shift = jnp.split(film, 2, axis=-1)
        x = x * (1.0 + scale) + shift
    return selu(x)


def summarize_v_h(inputs: jax.Array, film_from: int | None, layer_norm: bool) -> jax.Array | None:
    """What scales and shifts a network's layers: [..., FILM_SIZE], or None. Call inside a compact module."""
    return None if film_from is None else selu_layer(inputs[..., film_from:], FILM_SIZE, "hidden_v_h", layer_norm)


class JointActor(nn.Module):
    """A deterministic policy whose layers are the same for every joint: they see it, its place, and a summary of all.

    Takes the inputs of `chain_fk+jacobian` [..., 126], and gives an action for each joint [..., 7].
    """

    hidden_sizes: Sequence[int]
    layer_norm: bool = False

    @nn.compact
    def __call__(self, inputs: jax.Array) -> jax.Array:
        joints, rest = split_joints(inputs)
        x, summary = encode_joints(joints, rest, self.hidden_sizes, self.layer_norm)
        x = jnp.concatenate([x, beside_each(x, jnp.concatenate([summary, rest], axis=-1))], axis=-1)
        x = selu_layer(x, self.hidden_sizes[0], "hidden_each", self.layer_norm)
        init = nn.initializers.variance_scaling(1e-4, "fan_in", "truncated_normal")
        return jnp.tanh(nn.Dense(1, kernel_init=init, name="output")(x)[..., 0])


class JointCritic(nn.Module):
    """Action values from layers that are the same for every joint, whose action each sees, and a summary of them: [...]."""

    hidden_sizes: Sequence[int]
    layer_norm: bool = False

    @nn.compact
    def __call__(self, inputs: jax.Array, action: jax.Array) -> jax.Array:
        joints, rest = split_joints(inputs)
        joints = jnp.concatenate([joints, action[..., None]], axis=-1)
        _, summary = encode_joints(joints, rest, self.hidden_sizes, self.layer_norm)
        x = jnp.concatenate([summary, rest], axis=-1)
        for i, size in enumerate(self.hidden_sizes[1:]):
            x = selu_layer(x, size, f"hidden_{i}", self.layer_norm)
        init = nn.initializers.variance_scaling(1e-4, "fan_in", "truncated_normal")
        return nn.Dense(1, kernel_init=init, name="output")(x)[..., 0]


def encode_joints(
    joints: jax.Array, rest: jax.Array, hidden_sizes: Sequence[int], layer_norm: bool
) -> tuple[jax.Array, jax.Array]:
    """Two layers over each joint, with its place in the chain and the rest beside it: [..., 7, W], and their mean over the
    joints. Call inside a compact module."""
    num_joints = joints.shape[-2]
    place = jnp.broadcast_to(jnp.eye(num_joints), (*joints.shape[:-1], num_joints))
    x = jnp.concatenate([joints, place, beside_each(joints, rest)], axis=-1)
    for i in range(2):
        x = selu_layer(x, hidden_sizes[0], f"hidden_joint_{i}", layer_norm)
    return x, jnp.mean(x, axis=-2)


def beside_each(joints: jax.Array, values: jax.Array) -> jax.Array:
    """`values` [..., R] once for each joint: [..., 7, R]."""
    return jnp.broadcast_to(values[..., None, :], (*joints.shape[:-1], values.shape[-1]))

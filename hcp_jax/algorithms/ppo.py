"""PPO on a robot pool (paper, algorithm 2; Schulman et al. 2017).

train(state, n):                         one jitted call, buffers donated
  for each of n iterations:
    collect                              num_envs x unroll_length control steps
    compute_advantages                   GAE with termination and truncation apart
    for each epoch, each minibatch:      clipped surrogate + value + entropy, Adam
                                         networks and embedding have their own step sizes

With `embedding.identify_steps` the first iterations also identify the robots: policy and value function see zeros for v_h,
while embedding and forward model reduce the error of predicting the next observation. Then a fresh policy and value function
take over and see v_h, which stands still from there on.
"""

import functools
from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import jax
import jax.numpy as jnp
from brax.training.acme import running_statistics, specs
from flax import struct

from hcp_jax.algorithms.guard import Skipped, apply_update, init_skipped
from hcp_jax.algorithms.identification import (
    Actor,
    forward_model_variables,
    get_actor,
    prediction_loss,
    put_actor,
    standardize_embedding,
)
from hcp_jax.algorithms.losses import clipped_surrogate, clipped_value_loss
from hcp_jax.algorithms.optimizers import make_ppo_optimizer
from hcp_jax.algorithms.returns import compute_gae
from hcp_jax.config import EmbeddingConfig, PPOConfig
from hcp_jax.devices import put_everywhere, split_rows
from hcp_jax.envs.base import EnvState, Transition, draw_evenly
from hcp_jax.policies.conditioning import Conditioning
from hcp_jax.policies.distribution import gaussian_entropy, gaussian_log_prob, sample_gaussian
from hcp_jax.policies.networks import ActorCritic

Params = dict[str, Any]  # {"network": ..., "embedding": [N, K] or None}


class Env(Protocol):
    """What PPO needs of an environment (`hcp_jax.envs.base.PoolEnv`)."""

    observation_size: int
    action_size: int
    num_robots: int

    def reset(self, key: jax.Array, index: jax.Array) -> EnvState: ...
    def step(self, state: EnvState, action: jax.Array) -> tuple[EnvState, Transition]: ...


@struct.dataclass
class Batch:
    """Flattened samples of one iteration; every leaf has leading axis [T * B]."""

    obs: jax.Array
    next_obs: jax.Array
    action: jax.Array
    executed_action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    advantage: jax.Array
    target: jax.Array
    index: jax.Array


@struct.dataclass
class PPOState:
    """Everything that training carries from one iteration to the next.

    iteration: [] int32 iterations done; reserve: before the identification's end the actor to go on with, after it the one
    that robots were identified under, None without identification; model_statistics: of [obs, change of obs], the forward
    model's units, which stand still after the identification; diverged: [N] int32 episodes that each robot lost to non-finite
    physics; overflow: [] int32 control steps of worlds that overflowed; skipped: updates that were not finite; sums: running
    sums of metrics since they were last read.
    """

    # What a policy needs, and fitting v_h of new robots to it.
    policy_fields: ClassVar = ("iteration", "params", "reserve", "obs_statistics", "model_statistics")

    iteration: jax.Array
    params: Any
    reserve: Actor | None
    opt_state: Any
    obs_statistics: running_statistics.RunningStatisticsState
    model_statistics: running_statistics.RunningStatisticsState
    env_state: EnvState
    key: jax.Array
    diverged: jax.Array
    overflow: jax.Array
    skipped: Skipped
    sums: dict[str, jax.Array]

    def published(self) -> dict[str, Any]:
        """What a published policy holds."""
        return {name: getattr(self, name) for name in self.policy_fields}

    def with_published(self, content: dict[str, Any]) -> "PPOState":
        """This state with what `published` gave."""
        return self.replace(**content)


LOSS_METRICS = ("policy_loss", "value_loss", "entropy", "approx_kl", "clip_fraction", "prediction_loss")
SUMS = (*LOSS_METRICS, "iterations", "episodes", "episode_return", "episode_length", "value_error", "target_variance")


def zero_sums() -> dict[str, jax.Array]:
    return {name: jnp.zeros(()) for name in SUMS}


class PPO:
    """PPO for one environment and one source of v_h. Holds no state of its own."""

    def __init__(
        self,
        env: Env,
        conditioning: Conditioning,
        config: PPOConfig,
        embedding: EmbeddingConfig,
        num_envs: int,
        num_iterations: int,
        train_network: bool = True,
        train_forward_model: bool = True,
    ):
        """Args:
        env: a vectorised environment over a pool.
        conditioning: the source of v_h for the robots of that pool.
        config, embedding: settings; `num_minibatches` must divide `num_envs * unroll_length`.
        num_envs: parallel environments.
        num_iterations: length of the run, for the learning rate's decay.
        train_network: False freezes policy and value function, and the observation statistics.
        train_forward_model: False freezes the forward model, its statistics and so what v_h means.
        """
        self.env, self.conditioning, self.config, self.embedding = env, conditioning, config, embedding
        self.num_envs = num_envs
        self._train_network, self._train_forward_model = train_network, train_forward_model
        self.identify_iterations = 0
        if conditioning.is_learned and embedding.identify_steps:
            self.identify_iterations = max(1, round(embedding.identify_steps / (num_envs * config.unroll_length)))
        self.network = ActorCritic(
            env.action_size, env.observation_size, config.hidden_sizes, config.initial_log_std, self.identify_iterations > 0
        )
        self._optimizer = make_ppo_optimizer(
            config, embedding, num_iterations, self.identify_iterations, train_network, train_forward_model
        )
        self.train = jax.jit(self._train, donate_argnums=0)

    def init_params(self, key: jax.Array) -> Params:
        key_network, key_embedding = jax.random.split(key)
        obs, action = jnp.zeros((1, self.env.observation_size)), jnp.zeros((1, self.env.action_size))
        network = self.network.init(key_network, obs, action, jnp.zeros((1, self.conditioning.size)))
        return {"network": network, "embedding": self.conditioning.init(key_embedding)}

    def init(self, key: jax.Array) -> PPOState:
        """The state before the first iteration."""
        key, key_params, key_index, key_env, key_reserve = jax.random.split(key, 5)
        params = self.init_params(key_params)
        spec = specs.Array((self.env.observation_size,), jnp.float32)
        reserve = None
        if self.identify_iterations:
            reserve = get_actor(self.init_params(key_reserve), running_statistics.init_state(spec))
        return PPOState(
            iteration=jnp.int32(0),
            params=params,
            reserve=reserve,
            opt_state=self._optimizer.init(params),
            obs_statistics=running_statistics.init_state(spec),
            model_statistics=running_statistics.init_state(specs.Array((2 * self.env.observation_size,), jnp.float32)),
            env_state=self.env.reset(key_env, draw_evenly(key_index, self.env.num_robots, self.num_envs)),
            key=key,
            diverged=jnp.zeros(self.env.num_robots, jnp.int32),
            overflow=jnp.int32(0),
            skipped=init_skipped(self.env.num_robots),
            sums=zero_sums(),
        )

    def apply(self, network: dict, *inputs: jax.Array, method: str) -> Any:
        """A method of the networks (`act`, `value`, `predict`) with the parameters `network`."""
        return self.network.apply(network, *inputs, method=method)

    def normalize(self, obs: jax.Array, statistics: running_statistics.RunningStatisticsState) -> jax.Array:
        """The observation as the networks see it."""
        if not self.config.normalize_observation:
            return obs
        return running_statistics.normalize(obs, statistics, max_abs_value=10.0)

    def mean_action(self, network: dict, statistics, obs: jax.Array, v_h: jax.Array) -> jax.Array:
        """The deterministic policy: obs [B, O], v_h [B, K] -> action [B, A]."""
        return self.apply(network, self.normalize(obs, statistics), v_h, method="act")[0]

    def _train(self, state: PPOState, num_iterations: jax.Array) -> PPOState:
        state = jax.lax.fori_loop(0, num_iterations, lambda _, s: self._train_iteration(s), state)
        return put_everywhere(state.replace(env_state=None)).replace(env_state=split_rows(state.env_state))

    def _train_iteration(self, state: PPOState) -> PPOState:
        key, key_collect, key_update = jax.random.split(state.key, 3)
        env_state, (transitions, log_prob, action) = self._collect(state, key_collect)
        batch, episode_sums = self._make_batch(state, transitions, log_prob, action)
        if self.identify_iterations:
            identifies = state.iteration < self.identify_iterations
            state, losses = jax.lax.cond(identifies, self._learn_and_identify, self._learn, state, batch, key_update)
        else:
            state, losses = self._learn(state, batch, key_update)
        if self._train_network:
            state = state.replace(obs_statistics=running_statistics.update(state.obs_statistics, batch.obs))
        if self.identify_iterations:
            is_last = state.iteration + 1 == self.identify_iterations
            state = jax.lax.cond(is_last, self._change_actors, lambda state: state, state)
        sums = {"iterations": jnp.ones(()), **episode_sums, **losses}
        return state.replace(
            iteration=state.iteration + 1,
            env_state=env_state,
            key=key,
            diverged=state.diverged.at[transitions.index].add(transitions.diverged.astype(jnp.int32)),
            overflow=state.overflow + jnp.sum(transitions.overflow),
            sums={name: state.sums[name] + sums[name] for name in SUMS},
        )

    def _learn(self, state: PPOState, batch: Batch, key: jax.Array) -> tuple[PPOState, dict]:
        """One iteration's updates of policy and value function, and of the embedding unless it was identified."""
        state, losses = self._update(state, batch, key, self._ppo_loss)
        return state, losses | {"prediction_loss": jnp.zeros(())}

    def _learn_and_identify(self, state: PPOState, batch: Batch, key: jax.Array) -> tuple[PPOState, dict]:
        """The same with embedding and forward model."""
        if self._train_forward_model:
            variables = forward_model_variables(batch.obs, batch.next_obs)
            state = state.replace(model_statistics=running_statistics.update(state.model_statistics, variables))

        def loss(params: Params, minibatch: Batch, state: PPOState) -> tuple[jax.Array, dict]:
            ppo_loss, metrics = self._ppo_loss(params, minibatch, state)
            error = prediction_loss(
                functools.partial(self.apply, params["network"], method="predict"),
                forward_model_variables(minibatch.obs, minibatch.next_obs),
                state.model_statistics,
                minibatch.executed_action,
                self.conditioning.v_h(params["embedding"], minibatch.index),
            )
            return ppo_loss + error, metrics | {"prediction_loss": error}

        return self._update(state, batch, key, loss)

    def _change_actors(self, state: PPOState) -> PPOState:
        """Ends the identification: standardises the embedding and puts the actor in reserve to work."""
        assert state.reserve is not None
        params, obs_statistics = standardize_embedding(state.params), state.obs_statistics
        if not self._train_forward_model:  # v_h keeps its meaning, and the actor in reserve has acted before
            params, obs_statistics = state.params, state.reserve.obs_statistics
        params = params | {"network": put_actor(state.reserve, params["network"])}
        inner_states = state.opt_state.inner_states | {"network": self._optimizer.init(params).inner_states["network"]}
        return state.replace(
            params=params,
            reserve=get_actor(state.params, state.obs_statistics),
            opt_state=state.opt_state._replace(inner_states=inner_states),
            obs_statistics=obs_statistics,
        )

    def visible(self, state: PPOState, v_h: jax.Array) -> jax.Array:
        """v_h [..., K] as policy and value function see it: zeros as long as the robots are being identified."""
        if not self.identify_iterations:
            return v_h
        return jnp.where(state.iteration < self.identify_iterations, 0.0, jax.lax.stop_gradient(v_h))

    def _collect(self, state: PPOState, key: jax.Array):
        """Rolls the current policy out: transitions, log_prob, sampled action, each [T, B, ...]."""

        def step(env_state, key_action):
            v_h = self.visible(state, self.conditioning.v_h(state.params["embedding"], env_state.index))
            obs = self.normalize(env_state.obs, state.obs_statistics)
            mean, log_std = self.apply(state.params["network"], obs, v_h, method="act")
            action = sample_gaussian(mean, log_std, key_action)
            log_prob = gaussian_log_prob(mean, log_std, action)
            env_state, transition = self.env.step(env_state, action)
            return split_rows(env_state), (transition, log_prob, action)

        return jax.lax.scan(step, split_rows(state.env_state), jax.random.split(key, self.config.unroll_length))

    def _make_batch(self, state: PPOState, transitions: Transition, log_prob, action) -> tuple[Batch, dict]:
        config = self.config
        v_h = self.visible(state, self.conditioning.v_h(state.params["embedding"], transitions.index))
        obs = self.normalize(transitions.obs, state.obs_statistics)
        next_obs = self.normalize(transitions.next_obs, state.obs_statistics)
        value = self.apply(state.params["network"], obs, v_h, method="value")
        next_value = self.apply(state.params["network"], next_obs, v_h, method="value")
        advantage, target = compute_gae(
            transitions.reward * config.reward_scale,
            value,
            next_value,
            transitions.terminated,
            transitions.truncated,
            config.gamma,
            config.gae_lambda,
        )
        batch = Batch(
            obs=transitions.obs,
            next_obs=transitions.next_obs,
            action=action,
            executed_action=transitions.action,
            log_prob=log_prob,
            value=value,
            advantage=(advantage - advantage.mean()) / (advantage.std() + 1e-8),
            target=target,
            index=transitions.index,
        )
        done = transitions.done
        sums = {
            "episodes": jnp.sum(done, dtype=jnp.float32),
            "episode_return": jnp.sum(jnp.where(done, transitions.episode_return, 0.0)),
            "episode_length": jnp.sum(jnp.where(done, transitions.episode_length, 0).astype(jnp.float32)),
            "value_error": jnp.mean(jnp.square(target - value)),
            "target_variance": jnp.var(target),
        }
        num_samples = self.num_envs * config.unroll_length
        return jax.tree.map(lambda x: x.reshape(num_samples, *x.shape[2:]), batch), sums

    def _update(self, state: PPOState, batch: Batch, key: jax.Array, loss: Callable) -> tuple[PPOState, dict]:
        """Epochs of minibatches. `loss(params, minibatch, state)` gives a loss and its metrics."""
        num_samples = batch.obs.shape[0]

        def minibatch_step(carry, rows):
            params, opt_state, skipped = carry
            minibatch = split_rows(jax.tree.map(lambda x: x[rows], batch))
            grads, metrics = jax.grad(loss, has_aux=True)(params, minibatch, state)
            params, opt_state, metrics, skipped = apply_update(
                self._optimizer, grads, metrics, params, opt_state, skipped, minibatch.index
            )
            return (params, opt_state, skipped), metrics

        def epoch(carry, key_epoch):
            rows = jax.random.permutation(key_epoch, num_samples)
            return jax.lax.scan(minibatch_step, carry, rows.reshape(self.config.num_minibatches, -1))

        keys = jax.random.split(key, self.config.num_epochs)
        carry, metrics = jax.lax.scan(epoch, (state.params, state.opt_state, state.skipped), keys)
        params, opt_state, skipped = carry
        return state.replace(params=params, opt_state=opt_state, skipped=skipped), jax.tree.map(jnp.mean, metrics)

    def _ppo_loss(self, params: Params, batch: Batch, state: PPOState) -> tuple[jax.Array, dict]:
        config = self.config
        v_h = self.visible(state, self.conditioning.v_h(params["embedding"], batch.index))
        obs = self.normalize(batch.obs, state.obs_statistics)
        mean, log_std = self.apply(params["network"], obs, v_h, method="act")
        value = self.apply(params["network"], obs, v_h, method="value")
        log_ratio = gaussian_log_prob(mean, log_std, batch.action) - batch.log_prob
        policy_loss = clipped_surrogate(log_ratio, batch.advantage, config.clip_eps)
        value_loss = clipped_value_loss(value, batch.value, batch.target, config.value_clip_eps)
        entropy = gaussian_entropy(log_std)
        metrics = {
            "policy_loss": policy_loss,
            "value_loss": value_loss,
            "entropy": entropy,
            "approx_kl": jnp.mean(jnp.exp(log_ratio) - 1.0 - log_ratio),
            "clip_fraction": jnp.mean((jnp.abs(jnp.exp(log_ratio) - 1.0) > config.clip_eps).astype(jnp.float32)),
        }
        return policy_loss + config.value_cost * value_loss - config.entropy_cost * entropy, metrics

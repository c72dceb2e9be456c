"""DDPG with hindsight experience replay on a robot pool (paper, algorithm 3; Lillicrap et al. 2016).

train(state, n):                         one jitted call, buffers donated
  for each of n iterations:
    collect                              one episode in each of num_envs worlds, in lockstep
    add_episodes                         whole, with the robot's index instead of its v_h
    for each of updates_per_iteration:   draw steps, relabel goals, reward them
                                         critic towards the n-step return and Q' unless it succeeds, actor up the critic
                                         targets follow
    the mean of the actors, which is evaluated, follows
"""

import math
from typing import Any, ClassVar, Protocol

import jax
import jax.numpy as jnp
import optax
from brax.training.acme import running_statistics, specs
from flax import struct

from hcp_jax.algorithms.guard import Skipped, apply_update, init_skipped
from hcp_jax.algorithms.her import relabel_goals
from hcp_jax.algorithms.replay import EpisodeBatch, Replay, StepSample, add_episodes, episode_shapes, init_replay, sample_steps
from hcp_jax.config import DDPGConfig
from hcp_jax.devices import put_everywhere, split_rows
from hcp_jax.envs.goal import GoalState, GoalTransition
from hcp_jax.policies.networks import Critic, DeterministicActor, JointActor, JointCritic

Params = dict[str, Any]  # {"actor": ..., "critic": ... with a leading axis of critics, "embedding": [N, K] or None}


class Env(Protocol):
    """What DDPG needs of an environment (`hcp_jax.envs.goal.GoalEnv`)."""

    observation_size: int
    action_size: int
    goal_size: int
    num_robots: int
    episode_length: int

    def reset(self, key: jax.Array, index: jax.Array) -> GoalState: ...
    def step(self, state: GoalState, action: jax.Array) -> tuple[GoalState, GoalTransition]: ...
    def compute_reward(
        self, achieved_goal: jax.Array, desired_goal: jax.Array, action: jax.Array
    ) -> tuple[jax.Array, jax.Array]: ...


class NetworkInputs(Protocol):
    """What DDPG needs of a conditioning (`hcp_jax.policies.goal_conditioning.GoalConditioning`)."""

    size: int

    def init(self, key: jax.Array) -> jax.Array | None: ...
    def inputs(self, embedding: jax.Array | None, index: jax.Array, obs: jax.Array, goal: jax.Array) -> jax.Array: ...


@struct.dataclass
class DDPGState:
    """Everything that training carries from one iteration to the next.

    iteration: [] int32 iterations done; average_actor: running mean of the actors after each iteration, the policy that is
    evaluated; statistics: of the networks' inputs; failure: [N] running mean of each robot's failures; diverged: [N] int32
    episodes that each robot lost to non-finite physics; overflow: [] int32; skipped: updates that were not finite; sums:
    running sums of metrics since they were last read.
    """

    policy_fields: ClassVar = ("iteration", "params", "average_actor", "statistics")

    iteration: jax.Array
    params: Any
    target_params: Any
    average_actor: Any
    opt_state: Any
    statistics: running_statistics.RunningStatisticsState
    replay: Replay
    key: jax.Array
    failure: jax.Array
    diverged: jax.Array
    overflow: jax.Array
    skipped: Skipped
    sums: dict[str, jax.Array]


MIN_STD = 1e-6  # to which brax's running statistics are clipped from below
FAILURE_STEP = 0.2  # of a robot's running mean of failures, per episode
LOSS_METRICS = ("critic_loss", "actor_loss", "q")
SUMS = (*LOSS_METRICS, "iterations", "updates", "episodes", "successes", "final_distance")


def zero_sums() -> dict[str, jax.Array]:
    return {name: jnp.zeros(()) for name in SUMS}


class DDPG:
    """DDPG for one environment and one source of v_h. Holds no state of its own."""

    def __init__(
        self,
        env: Env,
        conditioning: NetworkInputs,
        config: DDPGConfig,
        num_envs: int,
        num_iterations: int,
        embedding_learning_rate: float,
    ):
        """Args:
        env: a goal-conditioned environment over a pool.
        conditioning: builds the networks' inputs for the robots of that pool.
        config: settings; `buffer_episodes` must be at least `num_envs`.
        num_envs: episodes collected per iteration.
        num_iterations: length of the run, for the learning rates' decay.
        embedding_learning_rate: Adam's step for a learned v_h.
        """
        self.env, self.conditioning, self.config, self.num_envs = env, conditioning, config, num_envs
        if config.network == "joints":
            self.actor = JointActor(config.hidden_sizes, config.layer_norm)
            self.critic = JointCritic(config.hidden_sizes, config.layer_norm)
        else:
            self.actor = DeterministicActor(config.hidden_sizes, env.action_size, config.layer_norm)
            self.critic = Critic(config.hidden_sizes, config.layer_norm)
        weight_decay = optax.add_decayed_weights(config.critic_weight_decay, mask=mark_kernels)
        self._num_iterations = num_iterations
        num_updates = num_iterations * config.updates_per_iteration

        def adam(rate: float) -> optax.GradientTransformation:
            return optax.adam(optax.linear_schedule(rate, rate * config.learning_rate_decay, num_updates))

        self._optimizer = optax.multi_transform(
            {
                "actor": adam(config.actor_learning_rate),
                "critic": optax.chain(weight_decay, adam(config.critic_learning_rate)),
                "embedding": adam(embedding_learning_rate),
            },
            {"actor": "actor", "critic": "critic", "embedding": "embedding"},
        )
        self.train = jax.jit(self._train, donate_argnums=0)

    def buffer_shapes(self) -> EpisodeBatch:
        """Shapes of the replay buffer."""
        env = self.env
        return episode_shapes(
            self.config.buffer_episodes, env.episode_length, env.observation_size, env.action_size, env.goal_size
        )

    def init(self, key: jax.Array) -> DDPGState:
        """The state before the first iteration."""
        key, key_actor, key_critic, key_embedding = jax.random.split(key, 4)
        inputs, action = jnp.zeros((1, self.conditioning.size)), jnp.zeros((1, self.env.action_size))
        keys = jax.random.split(key_critic, 2 if self.config.double_critic else 1)
        params = {
            "actor": self.actor.init(key_actor, inputs),
            "critic": jax.vmap(self.critic.init, in_axes=(0, None, None))(keys, inputs, action),
            "embedding": self.conditioning.init(key_embedding),
        }
        return DDPGState(
            iteration=jnp.int32(0),
            params=params,
            target_params=jax.tree.map(jnp.copy, {name: params[name] for name in ("actor", "critic")}),
            average_actor=jax.tree.map(jnp.copy, params["actor"]),
            opt_state=self._optimizer.init(params),
            statistics=running_statistics.init_state(specs.Array((self.conditioning.size,), jnp.float32)),
            replay=init_replay(self.buffer_shapes()),
            key=key,
            failure=jnp.ones(self.env.num_robots),
            diverged=jnp.zeros(self.env.num_robots, jnp.int32),
            overflow=jnp.int32(0),
            skipped=init_skipped(self.env.num_robots),
            sums=zero_sums(),
        )

    def policy(self, state: DDPGState) -> tuple[Params, Any]:
        """What `mean_action` plays with the averaged actor: its params and statistics."""
        return state.params | {"actor": state.average_actor}, state.statistics

    def mean_action(
        self, params: Params, statistics, conditioning: NetworkInputs, index: jax.Array, obs: jax.Array, goal: jax.Array
    ) -> jax.Array:
        """The policy without exploration, for robots at `index` [B] of the pool that `conditioning` stands for: [B, A]."""
        inputs = conditioning.inputs(params["embedding"], index, obs, goal)
        return self._act(params["actor"], self.normalize(inputs, statistics))

    def normalize(self, inputs: jax.Array, statistics: running_statistics.RunningStatisticsState) -> jax.Array:
        """The inputs as the networks see them: 0 for those that never varied in training, of whatever arm this one is."""
        if not self.config.normalize_inputs:
            return inputs
        varied = statistics.std > MIN_STD
        return jnp.where(varied, running_statistics.normalize(inputs, statistics, max_abs_value=5.0), 0.0)

    def _train(self, state: DDPGState, num_iterations: jax.Array) -> DDPGState:
        return put_everywhere(jax.lax.fori_loop(0, num_iterations, lambda _, s: self._train_iteration(s), state))

    def _train_iteration(self, state: DDPGState) -> DDPGState:
        key, key_collect, key_update = jax.random.split(state.key, 3)
        episodes, failed, diverged, overflow, sums = self._collect(state, key_collect)
        change = FAILURE_STEP * (failed - state.failure[episodes.index])
        statistics = running_statistics.update(state.statistics, self._step_inputs(state.params["embedding"], episodes))
        state = state.replace(
            iteration=state.iteration + 1,
            key=key,
            statistics=statistics,
            replay=add_episodes(state.replay, episodes),
            failure=state.failure.at[episodes.index].add(change),
            diverged=state.diverged.at[episodes.index].add(diverged.astype(jnp.int32)),
            overflow=state.overflow + overflow,
            sums=state.sums | {name: state.sums[name] + value for name, value in sums.items()},
        )
        is_warm = state.replay.num_added >= self.config.warmup_episodes
        return jax.lax.cond(is_warm, self._learn, lambda state, key: state, state, key_update)

    def _collect(self, state: DDPGState, key: jax.Array) -> tuple[EpisodeBatch, jax.Array, jax.Array, jax.Array, dict]:
        """Plays `num_envs` episodes with the exploring policy; also which failed and diverged [B], overflows [] and metrics."""
        key_robots, key_reset, key_noise, key_steps = jax.random.split(key, 4)
        first = split_rows(self.env.reset(key_reset, self._draw_robots(state, key_robots)))
        correlation = self.config.exploration_correlation

        def step(carry: tuple[GoalState, jax.Array], key: jax.Array):
            env_state, noise = carry
            key_noise, key_action = jax.random.split(key)
            fresh = jax.random.normal(key_noise, noise.shape)
            noise = correlation * noise + math.sqrt(1.0 - correlation**2) * fresh
            action = self._explore(state, env_state, noise, key_action)
            next_state, transition = self.env.step(env_state, action)
            return (split_rows(next_state), noise), (env_state.obs, env_state.achieved_goal, transition)

        first_noise = jax.random.normal(key_noise, (self.num_envs, self.env.action_size))
        keys = jax.random.split(key_steps, self.env.episode_length)
        (last, _), (obs, achieved_goal, transitions) = jax.lax.scan(step, (first, first_noise), keys)
        ended = jnp.cumsum(transitions.diverged, axis=0) > 0
        is_over = ended
        if self.config.stop_at_success:  # after the step that succeeds
            is_over = ended | (jnp.cumsum(transitions.success, axis=0) - transitions.success > 0)
        episodes = EpisodeBatch(
            obs=jnp.swapaxes(jnp.concatenate([obs, last.obs[None]]), 0, 1),
            achieved_goal=jnp.swapaxes(jnp.concatenate([achieved_goal, last.achieved_goal[None]]), 0, 1),
            action=jnp.swapaxes(transitions.action, 0, 1),
            desired_goal=first.desired_goal,
            index=first.index,
            length=jnp.sum(~is_over, axis=0, dtype=jnp.int32),
        )
        succeeded = jnp.any(transitions.success, axis=0).astype(jnp.float32)
        sums = {
            "iterations": 1.0,
            "episodes": float(self.num_envs),
            "successes": jnp.sum(succeeded),
            "final_distance": jnp.sum(transitions.distance[-1]),
        }
        return episodes, 1.0 - succeeded, ended[-1], jnp.sum(transitions.overflow), sums

    def _draw_robots(self, state: DDPGState, key: jax.Array) -> jax.Array:
        """The iteration's robots: evenly, but for the share of those that fail. [B] int32."""
        even = draw_robots(key, self.env.num_robots, self.num_envs)
        if not self.config.failing_share:
            return even
        key_failing, key_choice = jax.random.split(jax.random.fold_in(key, 1))
        failing = jax.random.categorical(key_failing, jnp.log(state.failure + 1e-3), shape=even.shape).astype(jnp.int32)
        return jnp.where(jax.random.uniform(key_choice, even.shape) < self.config.failing_share, failing, even)

    def _explore(self, state: DDPGState, env_state: GoalState, noise: jax.Array, key: jax.Array) -> jax.Array:
        """The policy's action with standard Gaussian `noise` scaled, or a uniform one: always while the buffer warms up."""
        key_uniform, key_choice = jax.random.split(key)
        mean = self.mean_action(
            state.params, state.statistics, self.conditioning, env_state.index, env_state.obs, env_state.desired_goal
        )
        noisy = mean + self.config.exploration_noise * noise
        uniform = jax.random.uniform(key_uniform, mean.shape, minval=-1.0, maxval=1.0)
        is_warm = state.replay.num_added >= self.config.warmup_episodes
        share = jnp.where(is_warm, self.config.random_action_probability, 1.0)
        is_random = jax.random.uniform(key_choice, (mean.shape[0], 1)) < share
        return jnp.clip(jnp.where(is_random, uniform, noisy), -1.0, 1.0)

    def _step_inputs(self, embedding: jax.Array | None, episodes: EpisodeBatch) -> jax.Array:
        """The networks' inputs at every step of new episodes: [B, T, size]."""
        obs = episodes.obs[:, :-1]
        index = jnp.broadcast_to(episodes.index[:, None], obs.shape[:2])
        goal = jnp.broadcast_to(episodes.desired_goal[:, None], (*obs.shape[:2], self.env.goal_size))
        return self.conditioning.inputs(embedding, index, obs, goal)

    def _learn(self, state: DDPGState, key: jax.Array) -> DDPGState:
        """All updates of one iteration."""
        config = self.config
        num_steps = jnp.where(state.iteration > config.n_step_from * self._num_iterations, config.n_step, 1)

        def update(carry, key):
            params, target_params, opt_state, skipped = carry
            key_sample, key_goals = jax.random.split(key)
            sample = sample_steps(state.replay, key_sample, config.batch_size, config.n_step, num_steps)
            goal = relabel_goals(state.replay, sample, key_goals, config.relabel, config.future_k, config.future_candidates)
            sample, goal = split_rows((sample, goal))
            grads, metrics = jax.grad(self._loss, has_aux=True)(params, target_params, state.statistics, sample, goal)
            params, opt_state, metrics, skipped = apply_update(
                self._optimizer, grads, metrics, params, opt_state, skipped, sample.index
            )
            online = {name: params[name] for name in target_params}
            target_params = optax.incremental_update(online, target_params, self.config.tau)
            return (params, target_params, opt_state, skipped), metrics

        keys = jax.random.split(key, self.config.updates_per_iteration)
        carry, metrics = jax.lax.scan(update, (state.params, state.target_params, state.opt_state, state.skipped), keys)
        params, target_params, opt_state, skipped = carry
        sums = {name: state.sums[name] + jnp.sum(metrics[name]) for name in LOSS_METRICS}
        sums["updates"] = state.sums["updates"] + config.updates_per_iteration
        return state.replace(
            params=params,
            target_params=target_params,
            average_actor=optax.incremental_update(params["actor"], state.average_actor, 1.0 - config.actor_average),
            opt_state=opt_state,
            skipped=skipped,
            sums=state.sums | sums,
        )

    def _loss(self, params: Params, target_params: dict, statistics, sample: StepSample, goal: jax.Array):
        """Critic and actor loss in one: no gradient of one reaches the other's network, both reach a learned v_h.

        The actor's reaches it through the action alone, or v_h would drift to wherever the critic promises much.
        """
        frozen = jax.lax.stop_gradient(params)
        reward, success = self.env.compute_reward(sample.achieved_goal, goal[:, None], sample.action)
        reward, discount = sum_rewards(reward, success, sample.num_steps, self.config.gamma)

        def inputs(embedding, obs):
            return self.normalize(self.conditioning.inputs(embedding, sample.index, obs, goal), statistics)

        next_inputs = inputs(frozen["embedding"], sample.next_obs)
        next_action = self._act(target_params["actor"], next_inputs)
        next_value = jnp.min(self._values(target_params["critic"], next_inputs, next_action), axis=0)
        target = reward + discount * next_value
        now = inputs(params["embedding"], sample.obs)
        values = self._values(params["critic"], now, sample.action[:, 0])
        weight = sample.valid / jnp.maximum(jnp.sum(sample.valid), 1.0)
        critic_loss = jnp.sum(jnp.square(values - target) * weight)
        action = self._act(params["actor"], now)
        actor_loss = -jnp.sum(self._values(frozen["critic"], jax.lax.stop_gradient(now), action)[0] * weight)
        metrics = {"critic_loss": critic_loss, "actor_loss": actor_loss, "q": jnp.sum(values[0] * weight)}
        return critic_loss + actor_loss, metrics

    def _act(self, actor: Any, inputs: jax.Array) -> jax.Array:
        """Actions of the actor: [B, A]."""
        action: Any = self.actor.apply(actor, inputs)
        return action

    def _values(self, critic: Any, inputs: jax.Array, action: jax.Array) -> jax.Array:
        """Action values of each critic: [C, B]."""
        apply: Any = self.critic.apply
        return jax.vmap(apply, in_axes=(0, None, None))(critic, inputs, action)


def sum_rewards(reward: jax.Array, success: jax.Array, num_steps: jax.Array, gamma: float) -> tuple[jax.Array, jax.Array]:
    """The discounted rewards of runs of K steps until the first success, and what the value after them counts for.

    Args:
        reward, success: [N, K] of each step.
        num_steps: [N] of the K steps that count.
        gamma: discount per step.

    Returns:
        returns [N] and discounts [N] of the value of the state after `num_steps` steps, 0 after a success.
    """
    step = jnp.arange(reward.shape[1])
    success = success & (step < num_steps[:, None])
    is_before_success = jnp.cumsum(success, axis=1) - success == 0
    counts = is_before_success & (step < num_steps[:, None])
    discount = jnp.where(jnp.any(success, axis=1), 0.0, gamma ** num_steps.astype(reward.dtype))
    return jnp.sum(jnp.where(counts, gamma**step * reward, 0.0), axis=1), discount


def draw_robots(key: jax.Array, num_robots: int, num_envs: int) -> jax.Array:
    """Robots for `num_envs` episodes, none twice before each was drawn once: [B] int32."""
    keys = jax.random.split(key, -(-num_envs // num_robots))
    rows = jax.vmap(lambda key: jax.random.permutation(key, num_robots))(keys)
    return rows.reshape(-1)[:num_envs].astype(jnp.int32)


def mark_kernels(params: Any) -> Any:
    """True at the kernels of dense layers."""
    return jax.tree_util.tree_map_with_path(lambda path, _: getattr(path[-1], "key", None) == "kernel", params)

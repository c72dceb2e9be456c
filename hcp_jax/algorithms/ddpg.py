"""DDPG with hindsight experience replay on a robot pool (paper, algorithm 3; Lillicrap et al. 2016).

train(state, n):                         one jitted call, buffers donated
  for each of n iterations:
    play                                 one episode in each of num_envs worlds, in lockstep
    add_episodes                         whole, with the robot's index instead of its v_h
    for each of updates_per_iteration:   draw steps, relabel goals, reward them
                                         critic towards the n-step return and Q' unless it succeeds, actor up the critic
                                         targets follow
    the mean of the actors, which is evaluated, follows
"""

from typing import Any, ClassVar, Protocol

import jax
import jax.numpy as jnp
import optax
from brax.training.acme import running_statistics, specs
from flax import struct

from hcp_jax.algorithms.exploration import ExploredEnv, Explorer
from hcp_jax.algorithms.guard import Skipped, apply_update, init_skipped
from hcp_jax.algorithms.her import relabel_goals
from hcp_jax.algorithms.optimizers import make_ddpg_optimizer
from hcp_jax.algorithms.replay import EpisodeBatch, Replay, StepSample, add_episodes, episode_shapes, init_replay, sample_steps
from hcp_jax.algorithms.returns import compute_n_step_returns
from hcp_jax.config import DDPGConfig
from hcp_jax.devices import options_for_batch, put_everywhere, split_rows
from hcp_jax.policies.networks import Critic, DeterministicActor, JointActor, JointCritic

Params = dict[str, Any]  # {"actor": ..., "critic": ... with a leading axis of critics, "embedding": [N, K] or None}


class Env(ExploredEnv, Protocol):
    """What DDPG needs of an environment (`hcp_jax.envs.goal.GoalEnv`)."""

    observation_size: int
    goal_size: int

    def action_mask(self, index: jax.Array) -> jax.Array: ...
    def compute_reward(
        self, achieved_goal: jax.Array, desired_goal: jax.Array, action: jax.Array
    ) -> tuple[jax.Array, jax.Array]: ...


class NetworkInputs(Protocol):
    """What DDPG needs of a conditioning (`hcp_jax.policies.goal_conditioning.GoalConditioning`)."""

    size: int

    def init(self, key: jax.Array) -> jax.Array | None: ...
    def inputs(self, embedding: jax.Array | None, index: jax.Array, obs: jax.Array, goal: jax.Array) -> jax.Array:
        """Observation, goal, and whatever else: [B, size]."""
        ...


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

    def published(self) -> dict[str, Any]:
        """What a published policy holds: one actor, the mean."""
        params = self.params | {"actor": self.average_actor}
        return {"iteration": self.iteration, "params": params, "statistics": self.statistics}

    def with_published(self, content: dict[str, Any]) -> "DDPGState":
        """This state with what `published` gave; its last actor is the mean too."""
        return self.replace(**content, average_actor=content["params"]["actor"])


MIN_STD = 3e-4  # above what single precision makes of an input that is the same in every step, [m] or [rad]
LOSS_METRICS = ("critic_loss", "actor_loss", "q")
SUMS = (*LOSS_METRICS, "updates", "episodes", "successes", "final_distance")


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
        learns_statistics: bool = True,
    ):
        """Args:
        env: a goal-conditioned environment over a pool.
        conditioning: builds the networks' inputs for the robots of that pool.
        config: settings; `buffer_episodes` must be at least `num_envs`.
        num_envs: episodes collected per iteration.
        num_iterations: length of the run, for the learning rates' decay.
        embedding_learning_rate: Adam's step for a learned v_h.
        learns_statistics: else those of the inputs stay as they are in the first state.
        """
        self.env, self.conditioning, self.config, self.num_envs = env, conditioning, config, num_envs
        if config.network == "joints":
            self.actor = JointActor(config.hidden_sizes, config.layer_norm)
            self.critic = JointCritic(config.hidden_sizes, config.layer_norm)
        else:
            film_from = env.observation_size + env.goal_size if config.network == "film" else None
            self.actor = DeterministicActor(config.hidden_sizes, env.action_size, config.layer_norm, film_from)
            self.critic = Critic(config.hidden_sizes, config.layer_norm, film_from)
        self._num_iterations, self._learns_statistics = num_iterations, learns_statistics
        self._optimizer = make_ddpg_optimizer(config, num_iterations, embedding_learning_rate)
        self._explorer = Explorer(env, self._explored_action, config, num_envs)
        self.train = jax.jit(self._train, donate_argnums=0, compiler_options=options_for_batch(config.batch_size))

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
        seen = running_statistics.normalize(inputs, statistics, max_abs_value=5.0)
        return jnp.where(statistics.std > MIN_STD, seen, 0.0)  # pyright: ignore[reportOperatorIssue] (one array, not brax's Nest)

    def _train(self, state: DDPGState, num_iterations: jax.Array) -> DDPGState:
        return put_everywhere(jax.lax.fori_loop(0, num_iterations, lambda _, s: self._train_iteration(s), state))

    def _train_iteration(self, state: DDPGState) -> DDPGState:
        key, key_play, key_update, key_inputs = jax.random.split(state.key, 4)
        played = self._explorer.play((state.params, state.statistics), state.failure, self._is_warm(state), key_play)
        statistics = state.statistics
        if self._learns_statistics:
            inputs, weights = self._draw_inputs(state.params["embedding"], played.episodes, key_inputs)
            statistics = running_statistics.update(statistics, inputs, weights=weights)
        state = state.replace(
            iteration=state.iteration + 1,
            key=key,
            statistics=statistics,
            replay=add_episodes(state.replay, played.episodes),
            failure=played.failure,
            diverged=state.diverged.at[played.episodes.index].add(played.diverged.astype(jnp.int32)),
            overflow=state.overflow + played.overflow,
            sums=state.sums | {name: state.sums[name] + value for name, value in played.sums.items()},
        )
        return jax.lax.cond(self._is_warm(state), self._learn, lambda state, key: state, state, key_update)

    def _is_warm(self, state: DDPGState) -> jax.Array:
        """Whether the buffer holds enough to learn from: [] bool."""
        return state.replay.num_added >= self.config.warmup_episodes

    def _explored_action(self, learned: tuple, index: jax.Array, obs: jax.Array, goal: jax.Array) -> jax.Array:
        """The actor's, not its mean's, before noise: [B, A]."""
        params, statistics = learned
        return self.mean_action(params, statistics, self.conditioning, index, obs, goal)

    def _draw_inputs(self, embedding: jax.Array | None, episodes: EpisodeBatch, key: jax.Array) -> tuple[jax.Array, jax.Array]:
        """The networks' inputs at as many steps as new episodes have, drawn as those of an update are, goals of hindsight among
        them: [B * T, size], and their weights [B * T]."""
        num_episodes, num_steps = episodes.action.shape[:2]
        key_sample, key_goals = jax.random.split(key)
        new = Replay(episodes, jnp.int32(num_episodes))
        sample, goal = self._draw(new, key_sample, key_goals, num_episodes * num_steps)
        return self.conditioning.inputs(embedding, sample.index, sample.obs, goal), sample.valid.astype(jnp.float32)

    def _draw(
        self, replay: Replay, key_sample: jax.Array, key_goals: jax.Array, num_samples: int, num_steps: jax.Array | int = 1
    ) -> tuple[StepSample, jax.Array]:
        """Runs of `num_steps` steps to learn from, and their goals [N, G]."""
        config = self.config
        sample = sample_steps(replay, key_sample, num_samples, config.n_step, num_steps)
        goal = relabel_goals(replay, sample, key_goals, config.relabel, config.future_k, config.future_candidates)
        return split_rows((sample, goal))

    def _learn(self, state: DDPGState, key: jax.Array) -> DDPGState:
        """All updates of one iteration."""
        config = self.config
        num_steps = jnp.where(state.iteration > config.n_step_from * self._num_iterations, config.n_step, 1)

        def update(carry, key):
            params, target_params, opt_state, skipped = carry
            key_sample, key_goals = jax.random.split(key)
            sample, goal = self._draw(state.replay, key_sample, key_goals, config.batch_size, num_steps)
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
        reward, discount = compute_n_step_returns(reward, success, sample.num_steps, self.config.gamma)

        def inputs(embedding, obs):
            return self.normalize(self.conditioning.inputs(embedding, sample.index, obs, goal), statistics)

        mask = self.env.action_mask(sample.index)  # the critic has seen nothing but 0 where a robot lacks the joint
        next_inputs = inputs(frozen["embedding"], sample.next_obs)
        next_action = self._act(target_params["actor"], next_inputs) * mask
        next_value = jnp.min(self._values(target_params["critic"], next_inputs, next_action), axis=0)
        target = reward + discount * next_value
        now = inputs(params["embedding"], sample.obs)
        values = self._values(params["critic"], now, sample.action[:, 0])
        weight = sample.valid / jnp.maximum(jnp.sum(sample.valid), 1.0)
        critic_loss = jnp.sum(jnp.square(values - target) * weight)
        action = self._act(params["actor"], now) * mask
        actor_loss = -jnp.sum(self._values(frozen["critic"], jax.lax.stop_gradient(now), action)[0] * weight)
        metrics = {"critic_loss": critic_loss, "actor_loss": actor_loss, "q": jnp.sum(values[0] * weight)}
        return critic_loss + actor_loss, metrics

    def _act(self, actor: Any, inputs: jax.Array) -> jax.Array:
        """Actions of the actor: [B, A]."""
        action: Any = self.actor.apply(actor, inputs)
        return action

    def _values(self, critic: Any, inputs: jax.Array, action: jax.Array) -> jax.Array:
        """Action values of each critic: [C, B]. One after the other: vmap over a single critic copies its kernels on a CPU."""
        rows = range(len(jax.tree.leaves(critic)[0]))
        each = [jax.tree.map(lambda leaf, row=row: leaf[row], critic) for row in rows]
        return jnp.stack([jnp.asarray(self.critic.apply(params, inputs, action)) for params in each])

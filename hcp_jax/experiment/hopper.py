"""The hopper's experiments: PPO on a pool of hoppers, evaluated on robots trained on and on held-out ones."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.algorithms.identification import get_actor, put_actor
from hcp_jax.algorithms.ppo import LOSS_METRICS, PPO, Params, PPOState
from hcp_jax.config import Config, HopperConfig, HopperPoolConfig
from hcp_jax.devices import copy_tree, replicate
from hcp_jax.envs.base import PoolEnv
from hcp_jax.envs.episodes import Episodes, Evaluator
from hcp_jax.envs.hopper import Hopper
from hcp_jax.experiment.base import EVALUATION_SEED, FIT, TRAIN
from hcp_jax.hardware.encodings import encode
from hcp_jax.hardware.hopper import make_hopper_pool
from hcp_jax.hardware.pool import RobotPool, concatenate_pools
from hcp_jax.physics.build import make_physics
from hcp_jax.policies.conditioning import Conditioning, Embedding, Encoding


@dataclasses.dataclass(frozen=True)
class HopperExperiment:
    """A config's objects. The evaluator's pool holds the first training robots, then as many held-out ones: `eval_robots` of
    each, or as many as the smaller pool has."""

    config: Config
    physics: str
    train_pool: RobotPool
    heldout_pool: RobotPool
    learner: PPO
    make_env: Callable[..., PoolEnv]
    evaluator: Evaluator
    fitter: "EmbeddingFitter | None" = None
    best_metric: ClassVar[str] = "train_return_mean"

    @property
    def num_evaluated(self) -> int:
        """Robots of each kind in an evaluation."""
        return self.evaluator.env.num_robots // 2

    def robot_inputs(self, pool: RobotPool) -> Callable[[jax.Array, jax.Array], jax.Array]:
        table = jnp.asarray(encode(pool, self.config.encoding, self.train_pool))
        return lambda index, obs: jnp.concatenate([obs, table[index]], axis=-1)

    def init_state(self) -> PPOState:
        return replicate(self.learner.init(jax.random.fold_in(jax.random.key(self.config.seed), TRAIN)))

    def introduce(self, iteration: int) -> list[str]:
        """Lines to say before training goes on from `iteration`."""
        config = self.config
        lines = [f"{config.resolved_num_envs} environments, physics {self.physics}, encoding {config.encoding}"]
        if iteration < self.learner.identify_iterations:
            steps = self.learner.identify_iterations * config.steps_per_iteration
            lines.append(f"identifying robots for {steps:,} steps; after that the policy starts afresh and sees v_h")
        return lines

    def evaluate(self, state: PPOState) -> tuple[dict[str, float | None], str]:
        """Metrics of one deterministic episode per evaluated robot, and what to say about them."""
        trained, heldout = evaluate_run(self, state)
        fitted = evaluate_run(self, state, self.fitter(state))[1] if self.fitter else None
        metrics = summarise(trained, heldout, fitted)
        line = f"return {metrics['train_return_mean']:.0f} on training robots, {metrics['heldout_return_mean']:.0f} held out"
        if fitted is not None:
            line += f", {metrics['heldout_fitted_return_mean']:.0f} held out with fitted v_h"
        return metrics, line

    def learner_metrics(self, state: PPOState) -> dict[str, float | int]:
        """Means since the last evaluation."""
        sums = {name: float(value) for name, value in state.sums.items()}
        iterations, episodes = max(sums["iterations"], 1.0), sums["episodes"]
        return {
            "episode_return": sums["episode_return"] / episodes if episodes else math.nan,
            "episode_length": sums["episode_length"] / episodes if episodes else math.nan,
            **{name: sums[name] / iterations for name in LOSS_METRICS},
            "explained_variance": 1.0 - sums["value_error"] / max(sums["target_variance"], 1e-12),
        }

    def describe(self, state: PPOState) -> str:
        """The return of training episodes since the last evaluation, for the progress line."""
        episodes = float(state.sums["episodes"])
        return f"return {float(state.sums['episode_return']) / episodes:>6.0f}" if episodes else "return    n/a"


def make_hopper_experiment(config: Config, physics: str) -> HopperExperiment:
    """Builds the pools, compiles the robots and sets up learner and evaluator.

    Args:
        config: the run's settings.
        physics: the engine, may be `native-INTEGRATOR`.
    """
    pool_config = config.pool
    assert isinstance(pool_config, HopperPoolConfig)
    assert isinstance(config.env, HopperConfig)
    train_pool = make_hopper_pool(pool_config.ranges, pool_config.num_robots, pool_config.seed, pool_config.split)
    heldout_pool = make_heldout_pool(pool_config, pool_config.num_heldout)
    task = Hopper(config.env.episode_length)

    def make_env(pool: RobotPool, engine: str = physics) -> PoolEnv:
        return PoolEnv(task, pool, make_physics(engine, pool, task.sim_dt, config.env.integrator))

    ppo = PPO(
        make_env(train_pool),
        make_conditioning(config, train_pool),
        config.ppo,
        config.embedding,
        config.resolved_num_envs,
        config.num_iterations,
        train_forward_model=not config.init,
    )
    rows = np.arange(min(config.eval_robots, train_pool.num_robots, heldout_pool.num_robots))
    evaluation_pool = concatenate_pools(train_pool.subset(rows), heldout_pool.subset(rows))
    evaluator = make_evaluator(ppo, make_env(evaluation_pool))
    run = HopperExperiment(config, physics, train_pool, heldout_pool, ppo, make_env, evaluator)
    if ppo.conditioning.is_learned and config.embedding.fit_steps:
        run = dataclasses.replace(run, fitter=EmbeddingFitter(run, heldout_pool, config.embedding.fit_steps))
    return run


def make_evaluator(ppo: PPO, env: PoolEnv) -> Evaluator:
    """Plays the robots of `env` with the mean action; its params are the network's and the observation statistics."""

    def policy(params, obs, v_h):
        network, statistics = params
        return ppo.mean_action(network, statistics, obs, v_h)

    return Evaluator(env, policy)


def make_heldout_pool(pool_config: HopperPoolConfig, num_robots: int) -> RobotPool:
    """Held-out robots 0..num_robots-1: no training pool of this seed contains them."""
    return make_hopper_pool(pool_config.ranges, num_robots, pool_config.seed, "heldout")


def make_conditioning(config: Config, train_pool: RobotPool) -> Conditioning:
    """The source of v_h for the training robots."""
    if config.encoding == "embedding":
        return Embedding(train_pool.num_robots, config.embedding.size, config.embedding.initial_scale)
    return Encoding(train_pool, config.encoding, train_pool)


def train_v_h(run: HopperExperiment, params: Params) -> jax.Array:
    """v_h of every training robot: [N, K]."""
    return run.learner.conditioning.v_h(params["embedding"], jnp.arange(run.train_pool.num_robots))


def heldout_v_h(run: HopperExperiment, params: Params, pool: RobotPool | None = None) -> jax.Array:
    """v_h of every robot of `pool`, by default the held-out one: [M, K].

    It is the robot's encoding or, where v_h is learned and so unknown, the mean over the training robots.
    """
    pool = run.heldout_pool if pool is None else pool
    if run.config.encoding == "embedding":
        return jnp.tile(params["embedding"].mean(axis=0), (pool.num_robots, 1))
    return jnp.asarray(encode(pool, run.config.encoding, run.train_pool))


def evaluate_run(run: HopperExperiment, state: PPOState, heldout: jax.Array | None = None) -> tuple[Episodes, Episodes]:
    """One deterministic episode of each evaluated robot: those trained on, and held-out ones with v_h `heldout` [M, K]."""
    count = run.num_evaluated
    heldout = heldout_v_h(run, state.params) if heldout is None else heldout
    v_h = run.learner.visible(state, jnp.concatenate([train_v_h(run, state.params)[:count], heldout[:count]]))
    policy_params = (state.params["network"], state.obs_statistics)
    episodes = run.evaluator(policy_params, v_h, np.arange(2 * count), jax.random.key(EVALUATION_SEED))
    return episodes.take(slice(0, count)), episodes.take(slice(count, None))


class EmbeddingFitter:
    """Learns v_h of a pool's robots from their experience, with the networks frozen (paper, section 5.2, made honest).

    It does what gave the training robots theirs, starting from their mean: v_h is identified under the actor that those were
    identified under, or it learns from policy and value loss.

    Attributes:
        steps_per_robot: control steps that it takes of each robot, in the mean.
    """

    def __init__(self, run: HopperExperiment, pool: RobotPool, steps_per_robot: int):
        """Args:
        run: the experiment whose robots the networks were trained on.
        pool: the new robots.
        steps_per_robot: control steps of experience with each of them, collected in `num_envs` environments; as near to it
            as whole iterations come.
        """
        config = run.config
        env_steps = steps_per_robot * pool.num_robots
        self._identify_iterations = run.learner.identify_iterations
        self._num_robots = pool.num_robots
        self._num_iterations = max(1, round(env_steps / config.steps_per_iteration))
        self.steps_per_robot = self._num_iterations * config.steps_per_iteration / pool.num_robots
        self._key = jax.random.fold_in(jax.random.key(config.seed), FIT)
        self._fitted: tuple[Any, jax.Array] | None = None  # what v_h was fitted to last, and v_h
        self._ppo = PPO(
            run.make_env(pool),
            Embedding(pool.num_robots, config.embedding.size, config.embedding.initial_scale),
            config.ppo,
            dataclasses.replace(config.embedding, identify_steps=env_steps if self._identify_iterations else 0),
            config.resolved_num_envs,
            self._num_iterations,
            train_network=False,
            train_forward_model=False,
        )

    def __call__(self, state: PPOState) -> jax.Array:
        """v_h of the new robots under the networks of `state`, which is left as it is: [num_robots, K].

        What it depends on stands still once the robots are identified: then it is fitted once.
        """
        is_identified = 0 < self._identify_iterations <= int(state.iteration)
        actor = get_actor(state.params, state.obs_statistics)
        if is_identified and state.reserve is not None:
            actor = state.reserve
        mean = jnp.tile(state.params["embedding"].mean(axis=0), (self._num_robots, 1))
        given = {
            "params": {"network": put_actor(actor, state.params["network"]), "embedding": mean},
            "obs_statistics": actor.obs_statistics,
            "model_statistics": state.model_statistics,
        }
        if self._fitted is None or not is_equal(self._fitted[0], given):
            fit_state = replicate(self._ppo.init(self._key)).replace(**copy_tree(given))
            v_h = self._ppo.train(fit_state, self._num_iterations).params["embedding"]
            self._fitted = jax.device_get(given), v_h
        return self._fitted[1]


def is_equal(one: Any, other: Any) -> bool:
    """Whether two trees of one structure hold the same numbers."""
    return all(jax.tree.leaves(jax.tree.map(np.array_equal, one, other)))


def summarise(trained: Episodes, heldout: Episodes, fitted: Episodes | None) -> dict[str, float | None]:
    """Mean and standard deviation over robots of the deterministic return, and mean episode length."""
    metrics: dict[str, float | None] = {}
    for name, episodes in (("train", trained), ("heldout", heldout), ("heldout_fitted", fitted)):
        metrics[f"{name}_return_mean"] = None if episodes is None else float(episodes.episode_return.mean())
        metrics[f"{name}_return_std"] = None if episodes is None else float(episodes.episode_return.std())
        metrics[f"{name}_episode_length"] = None if episodes is None else float(episodes.episode_length.mean())
    return metrics

"""What a config stands for: pools, environments, learner and evaluator, built once and used by every command."""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.algorithms.ppo import PPO, Params, PPOState, get_actor, put_actor
from hcp_jax.config import Config, PoolConfig
from hcp_jax.envs.base import PoolEnv
from hcp_jax.envs.episodes import Episodes, Evaluator
from hcp_jax.envs.hopper import Hopper
from hcp_jax.hardware.encodings import encode
from hcp_jax.hardware.hopper import make_hopper_pool
from hcp_jax.hardware.pool import RobotPool, concatenate_pools
from hcp_jax.physics.base import default_physics, make_physics
from hcp_jax.policies.conditioning import Conditioning, Embedding, Encoding

# Purposes of random draws from the training seed, and the fixed seed of evaluation episodes.
_TRAIN, _FIT = 0, 1
_EVALUATION_SEED = 20180101


@dataclasses.dataclass(frozen=True)
class Experiment:
    """A config's objects. `evaluation_pool` holds training robots 0..eval_robots-1, then the held-out ones."""

    config: Config
    physics: str
    train_pool: RobotPool
    heldout_pool: RobotPool
    ppo: PPO
    make_env: Callable[[RobotPool], PoolEnv]
    evaluator: Evaluator
    num_iterations: int

    @property
    def num_evaluated(self) -> int:
        """Robots of each kind in an evaluation."""
        return min(self.config.eval_robots, self.train_pool.num_robots, self.heldout_pool.num_robots)

    def init_state(self) -> PPOState:
        return self.ppo.init(jax.random.fold_in(jax.random.key(self.config.seed), _TRAIN))


def make_experiment(config: Config, physics: str | None = None) -> Experiment:
    """Builds the pools, compiles the robots and sets up learner and evaluator.

    Args:
        config: the run's settings.
        physics: overrules `config.physics`; may also be `native-INTEGRATOR`.
    """
    physics = physics or config.physics
    physics = default_physics() if physics == "auto" else physics
    pool_config = config.pool
    train_pool = make_hopper_pool(pool_config.ranges, pool_config.num_robots, pool_config.seed, pool_config.split)
    heldout_pool = make_heldout_pool(pool_config, pool_config.num_heldout)
    task = Hopper(config.env.episode_length)

    def make_env(pool: RobotPool) -> PoolEnv:
        return PoolEnv(task, pool, make_physics(physics, pool, task.sim_dt, config.env.integrator))

    num_iterations = -(-config.total_env_steps // config.batch_size)
    ppo = PPO(
        make_env(train_pool),
        make_conditioning(config, train_pool),
        config.ppo,
        config.embedding,
        config.resolved_num_envs,
        num_iterations,
        train_forward_model=not config.init,
    )
    num_evaluated = min(config.eval_robots, train_pool.num_robots, heldout_pool.num_robots)
    rows = np.arange(num_evaluated)
    evaluation_pool = concatenate_pools(train_pool.subset(rows), heldout_pool.subset(rows))

    def policy(params, obs, v_h):
        network, statistics = params
        return ppo.mean_action(network, statistics, obs, v_h)

    evaluator = Evaluator(make_env(evaluation_pool), policy)
    return Experiment(config, physics, train_pool, heldout_pool, ppo, make_env, evaluator, num_iterations)


def make_heldout_pool(pool_config: PoolConfig, num_robots: int) -> RobotPool:
    """Held-out robots 0..num_robots-1: no training pool of this seed contains them."""
    return make_hopper_pool(pool_config.ranges, num_robots, pool_config.seed, "heldout")


def make_conditioning(config: Config, train_pool: RobotPool) -> Conditioning:
    """The source of v_h for the training robots."""
    if config.encoding == "embedding":
        return Embedding(train_pool.num_robots, config.embedding.size, config.embedding.initial_scale)
    return Encoding(train_pool, config.encoding, train_pool)


def train_v_h(run: Experiment, params: Params) -> jax.Array:
    """v_h of every training robot: [N, K]."""
    return run.ppo.conditioning.v_h(params["embedding"], jnp.arange(run.train_pool.num_robots))


def heldout_v_h(run: Experiment, params: Params, pool: RobotPool | None = None) -> jax.Array:
    """v_h of every robot of `pool`, by default the held-out one: [M, K].

    It is the robot's encoding or, where v_h is learned and so unknown, the mean over the training robots.
    """
    pool = run.heldout_pool if pool is None else pool
    if run.config.encoding == "embedding":
        return jnp.tile(params["embedding"].mean(axis=0), (pool.num_robots, 1))
    return jnp.asarray(encode(pool, run.config.encoding, run.train_pool))


def evaluate_run(run: Experiment, state: PPOState, heldout: jax.Array | None = None) -> tuple[Episodes, Episodes]:
    """One deterministic episode of each evaluated robot: those trained on, and held-out ones with v_h `heldout` [M, K]."""
    count = run.num_evaluated
    heldout = heldout_v_h(run, state.params) if heldout is None else heldout
    v_h = run.ppo.visible(state, jnp.concatenate([train_v_h(run, state.params)[:count], heldout[:count]]))
    policy_params = (state.params["network"], state.obs_statistics)
    episodes = run.evaluator(policy_params, v_h, np.arange(2 * count), jax.random.key(_EVALUATION_SEED))
    return episodes.take(slice(0, count)), episodes.take(slice(count, None))


class EmbeddingFitter:
    """Learns v_h of a pool's robots from their experience, with the networks frozen (paper, section 5.2, made honest).

    It does what gave the training robots theirs, starting from their mean: v_h is identified under the actor that those were
    identified under, or it learns from policy and value loss.
    """

    def __init__(self, run: Experiment, pool: RobotPool, steps_per_robot: int):
        """Args:
        run: the experiment whose robots the networks were trained on.
        pool: the new robots.
        steps_per_robot: control steps of experience with each of them, collected in `num_envs` environments.
        """
        config = run.config
        env_steps = steps_per_robot * pool.num_robots
        self._identify_iterations = run.ppo.identify_iterations
        self._num_robots = pool.num_robots
        self._num_iterations = max(1, round(env_steps / config.batch_size))
        self._key = jax.random.fold_in(jax.random.key(config.seed), _FIT)
        self._identified: jax.Array | None = None
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
        """v_h of the new robots under the networks of `state`, which is left as it is: [num_robots, K]."""
        if self._identified is not None:
            return self._identified
        is_identified = 0 < self._identify_iterations <= int(state.iteration)
        actor = get_actor(state.params, state.obs_statistics)
        if is_identified and state.reserve is not None:
            actor = state.reserve
        mean = jnp.tile(state.params["embedding"].mean(axis=0), (self._num_robots, 1))
        params = {"network": put_actor(actor, state.params["network"]), "embedding": mean}
        fit_state = self._ppo.init(self._key).replace(
            params=copy_tree(params),
            obs_statistics=copy_tree(actor.obs_statistics),
            model_statistics=copy_tree(state.model_statistics),
        )
        v_h = self._ppo.train(fit_state, self._num_iterations).params["embedding"]
        if is_identified:  # what it depends on stands still from here on
            self._identified = v_h
        return v_h


def copy_tree(tree):
    """Fresh buffers, so that donating them leaves the original alone."""
    return jax.tree.map(jnp.copy, tree)

"""The arm's experiments: DDPG with hindsight on a pool of arm types, evaluated on held-out variants and on types left out."""

import dataclasses
import os
import pathlib
from collections.abc import Callable
from typing import ClassVar

import jax
import numpy as np

from hcp_jax.algorithms.ddpg import DDPG, LOSS_METRICS, DDPGState
from hcp_jax.algorithms.replay import replay_bytes
from hcp_jax.config import ArmConfig, ArmPoolConfig, Config, ConfigError
from hcp_jax.devices import replicate
from hcp_jax.envs.arm import HOLE, ArmTask
from hcp_jax.envs.goal import GoalEnv
from hcp_jax.envs.goal_episodes import GoalEpisodes, GoalEvaluator
from hcp_jax.experiment.base import EVALUATION_SEED, TRAIN
from hcp_jax.hardware.approach_poses import add_approach_poses
from hcp_jax.hardware.arm import OWN_TYPE, type_name
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.hardware.own_arm import make_own_pool, make_own_variants
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.robot_file import RobotFile
from hcp_jax.physics.base import chosen_integrator
from hcp_jax.physics.build import make_physics
from hcp_jax.policies.conditioning import Embedding
from hcp_jax.policies.goal_conditioning import GoalConditioning


@dataclasses.dataclass(frozen=True)
class ArmExperiment:
    """A config's objects. `heldout_pool` holds held-out variants of the training types, then of the types left out;
    `trained_evaluator` plays training robots with the v_h that each has learned, if v_h is learned."""

    config: Config
    physics: str
    train_pool: RobotPool
    heldout_pool: RobotPool
    learner: DDPG
    make_env: Callable[..., GoalEnv]
    evaluator: GoalEvaluator
    trained_evaluator: GoalEvaluator | None
    best_metric: ClassVar[str] = "train_types_success"

    def robot_inputs(self, pool: RobotPool) -> Callable[[jax.Array, jax.Array], jax.Array]:
        return make_goal_conditioning(self.config, pool, self.train_pool).robot_inputs

    def init_state(self) -> DDPGState:
        return replicate(self.learner.init(jax.random.fold_in(jax.random.key(self.config.seed), TRAIN)))

    def introduce(self, iteration: int) -> list[str]:
        """Lines to say before training goes on."""
        config, megabytes = self.config, replay_bytes(self.learner.buffer_shapes()) / 1e6
        trained = [name for name in self.pool_config.left_out if name in self.pool_config.types]
        warnings = [f"warning: type {name} is in pool.types and in pool.left_out: it is not zero-shot" for name in trained]
        return [
            *warnings,
            f"{config.resolved_num_envs} environments, physics {self.physics}, encoding {config.encoding}",
            f"replay buffer of {config.ddpg.buffer_episodes:,} episodes, {megabytes:,.0f} MB; as much in each checkpoint",
        ]

    def evaluate(self, state: DDPGState) -> tuple[dict[str, float | None], str]:
        """Success in percent of one episode per held-out robot, by kind and by type, and what to say about it."""
        policy = self.learner.policy(state)
        episodes = self.evaluator(policy, np.arange(self.heldout_pool.num_robots), jax.random.key(EVALUATION_SEED))
        types = np.asarray([type_name(number) for number in self.heldout_pool.hardware["type"][:, 0]])
        names = tuple(dict.fromkeys(types))
        untrained = [name for name in names if name not in (*self.pool_config.types, OWN_TYPE)]
        left_out = np.isin(types, untrained)
        metrics = summarise("train_types", episodes.take(~left_out))
        robots = own_robot_name(self.config) or "held-out robots of the training types"
        line = f"success {metrics['train_types_success']:.1f} % on {robots}"
        if left_out.any():
            metrics |= summarise("left_out", episodes.take(left_out))
            line += f", {metrics['left_out_success']:.1f} % zero-shot on type {', '.join(untrained)}"
        if self.trained_evaluator is not None:
            index = first_of_each_type(self.train_pool, self.pool_config.heldout_per_type)
            metrics |= summarise("training_robots", self.trained_evaluator(policy, index, jax.random.key(EVALUATION_SEED)))
            line += f", {metrics['training_robots_success']:.1f} % on training robots with their own v_h"
        for name in names:
            metrics[f"success_{name}"] = 100.0 * float(episodes.success[types == name].mean())
        return metrics, line

    @property
    def pool_config(self) -> ArmPoolConfig:
        assert isinstance(self.config.pool, ArmPoolConfig)
        return self.config.pool

    def learner_metrics(self, state: DDPGState) -> dict[str, float | int]:
        """Means since the last evaluation."""
        sums = {name: float(value) for name, value in state.sums.items()}
        updates, episodes = max(sums["updates"], 1.0), max(sums["episodes"], 1.0)
        return {
            "exploring_success": 100.0 * sums["successes"] / episodes,
            "exploring_final_distance": sums["final_distance"] / episodes,
            **{name: sums[name] / updates for name in LOSS_METRICS},
        }

    def describe(self, state: DDPGState) -> str:
        """Success of exploring episodes since the last evaluation, approach starts among them, for the progress line."""
        episodes = float(state.sums["episodes"])
        return f"exploring succeeds in {100.0 * float(state.sums['successes']) / episodes:>5.1f} %" if episodes else "exploring"


def make_arm_experiment(config: Config, physics: str) -> ArmExperiment:
    """Builds the pools, compiles the arms and sets up learner and evaluator.

    Args:
        config: the run's settings.
        physics: the engine, may be `native-INTEGRATOR`.
    """
    pools, env_config = config.pool, config.env
    assert isinstance(pools, ArmPoolConfig)
    assert isinstance(env_config, ArmConfig)
    if config.robot:
        train_pool, heldout_pool = make_own_pools(config)
    else:
        train_pool = make_train_arms(config)
        types = tuple(dict.fromkeys((*pools.types, *pools.left_out)))
        heldout_pool = make_heldout_arms(config, types, pools.heldout_per_type)
    task = ArmTask(config.task, **dataclasses.asdict(env_config))

    def make_env(pool: RobotPool, engine: str = physics, approach_starts: float = 0.0) -> GoalEnv:
        integrator = chosen_integrator(engine, env_config.integrator)
        stepped = dataclasses.replace(task, integrator=integrator, approach_starts=approach_starts)
        return GoalEnv(stepped, pool, make_physics(engine, pool, stepped.sim_dt, integrator))

    starts_pool = train_pool
    if env_config.approach_starts:
        starts_pool = add_approach_poses(train_pool, np.asarray(HOLE), env_config.random_hole, pools.seed)
    learner = DDPG(
        make_env(starts_pool, approach_starts=env_config.approach_starts),
        make_goal_conditioning(config, train_pool, train_pool),
        config.ddpg,
        config.resolved_num_envs,
        config.num_iterations,
        config.embedding.learning_rate,
        learns_statistics=not config.init,
    )
    check_memory(config, replay_bytes(learner.buffer_shapes()))
    evaluator = make_evaluator(config, learner, make_env, heldout_pool, train_pool)
    trained_evaluator = None
    if config.encoding == "embedding":
        trained_evaluator = make_evaluator(config, learner, make_env, train_pool, train_pool)
    return ArmExperiment(config, physics, train_pool, heldout_pool, learner, make_env, evaluator, trained_evaluator)


def check_memory(config: Config, num_bytes: int) -> None:
    """Raises ConfigError if a replay buffer of `num_bytes` does not fit the device that trains."""
    stats = jax.local_devices()[0].memory_stats() or {}
    memory = stats.get("bytes_limit") or os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if num_bytes > memory:
        raise ConfigError(
            f"ddpg.buffer_episodes={config.ddpg.buffer_episodes}: needs {num_bytes / 1e9:,.1f} GB, the device has "
            f"{memory / 1e9:,.1f} GB: expected at most {config.ddpg.buffer_episodes * memory // num_bytes}"
        )


def make_train_arms(config: Config) -> RobotPool:
    """The arms that are trained on, `pool.robots_per_type` of each of `pool.types`."""
    pools = config.pool
    assert isinstance(pools, ArmPoolConfig)
    drawn = (pools.types, pools.robots_per_type, pools.seed, pools.split, pools.chain_ranges)
    return make_arm_pool(config.task, pools.ranges, *drawn)


def make_heldout_arms(config: Config, types: tuple[str, ...], num_per_type: int) -> RobotPool:
    """Held-out robots 0..num_per_type-1 of each of `types`: no training pool of this seed contains them."""
    pools = config.pool
    assert isinstance(pools, ArmPoolConfig)
    return make_arm_pool(config.task, pools.ranges, types, num_per_type, pools.seed, "heldout", pools.chain_ranges)


def own_robot_name(config: Config) -> str:
    """What records call the arm from a file that a run was trained on; empty without one."""
    return pathlib.Path(config.robot).stem


def load_own_robot(config: Config) -> RobotFile:
    """The arm that `config.robot` names. Raises RobotFileError."""
    return load_robot(config.robot, config.robot_base or None, config.robot_tip or None)


def make_own_pools(config: Config) -> tuple[RobotPool, RobotPool]:
    """What is trained on and what is evaluated where `config.robot` names an arm. Raises RobotFileError."""
    pools = config.pool
    assert isinstance(pools, ArmPoolConfig)
    robot = load_own_robot(config)
    own = make_own_pool(config.task, robot)
    count = pools.heldout_per_type
    heldout = own.subset(np.zeros(count, int)).replace(robot_id=own.robot_id + np.arange(count, dtype=np.int32))
    if pools.robots_per_type == 1:
        return own, heldout
    return make_own_variants(config.task, robot, pools.ranges, pools.robots_per_type, pools.seed), heldout


def make_goal_conditioning(config: Config, pool: RobotPool, train_pool: RobotPool) -> GoalConditioning:
    """The networks' inputs for robots of `pool`; a learned v_h has a row for each of them."""
    embedding = None
    if config.encoding == "embedding":
        embedding = Embedding(pool.num_robots, config.embedding.size, config.embedding.initial_scale)
    assert isinstance(config.env, ArmConfig)
    sizes = (ArmTask.observation_size, ArmTask.goal_size)
    return GoalConditioning(pool, config.encoding, train_pool, *sizes, embedding, config.env.joint_slots)


def make_evaluator(
    config: Config, learner: DDPG, make_env: Callable[..., GoalEnv], pool: RobotPool, train_pool: RobotPool
) -> GoalEvaluator:
    """Plays robots of `pool`. Where v_h is learned, those of the training pool have their own; that of others is unknown: the
    mean of the training robots'."""
    conditioning = make_goal_conditioning(config, pool, train_pool)

    def policy(params, index, obs, goal):
        networks, statistics = params
        if conditioning.is_learned and pool is not train_pool:
            mean = networks["embedding"].mean(axis=0)
            networks = networks | {"embedding": jax.numpy.tile(mean, (pool.num_robots, 1))}
        return learner.mean_action(networks, statistics, conditioning, index, obs, goal)

    return GoalEvaluator(make_env(pool), policy)


def first_of_each_type(pool: RobotPool, count: int) -> np.ndarray:
    """Positions of the first `count` robots of each type in `pool`, or of all where a type has fewer."""
    types = pool.hardware["type"][:, 0]
    return np.sort(np.concatenate([np.flatnonzero(types == number)[:count] for number in np.unique(types)]))


def summarise(kind: str, episodes: GoalEpisodes) -> dict[str, float | None]:
    """Success in percent, final distance and episode length of one kind of robots."""
    return {
        f"{kind}_success": 100.0 * float(episodes.success.mean()),
        f"{kind}_final_distance": float(episodes.final_distance.mean()),
        f"{kind}_episode_length": float(episodes.episode_length.mean()),
    }

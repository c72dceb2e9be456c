"""Pools, engines and rollouts that several test files use, built and compiled once per session."""

import dataclasses
import functools
import os
import pathlib

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import numpy as np
import pytest

from hcp_jax import command_line
from hcp_jax.config import (
    ArmConfig,
    ArmPoolConfig,
    Config,
    DDPGConfig,
    EmbeddingConfig,
    HopperConfig,
    HopperPoolConfig,
    PPOConfig,
)
from hcp_jax.hardware.hopper import make_hopper_pool
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.hardware.ranges import HopperRanges
from hcp_jax.training import loop

ROOT = pathlib.Path(__file__).resolve().parents[1]
command_line.enable_compilation_cache()


@pytest.fixture(scope="session", autouse=True)
def compiled_once():
    """An experiment is built, and its training step compiled, once per session, however often it is trained."""
    build = functools.cache(loop.make_experiment)

    def make_experiment(config: Config):
        seed = config.seed if config.encoding == "embedding" else 0  # fitting v_h has the seed in what is compiled
        run = build(dataclasses.replace(config, name="any", seed=seed))
        return dataclasses.replace(run, config=config)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "make_experiment", make_experiment)
        yield


@pytest.fixture(scope="session")
def pool() -> RobotPool:
    """64 training hoppers."""
    return make_hopper_pool(HopperRanges(), 64, seed=0)


@pytest.fixture(scope="session")
def tiny_config() -> Config:
    """HCP-I on 8 hoppers, small enough to train in seconds."""
    return Config(
        name="tiny",
        encoding="embedding",
        total_env_steps=512,
        eval_every=128,
        eval_robots=4,
        pool=HopperPoolConfig(num_robots=8, num_heldout=4),
        env=HopperConfig(episode_length=24, integrator="euler"),
        ppo=PPOConfig(unroll_length=8, num_minibatches=2, num_epochs=2, hidden_sizes=(8, 8), normalize_observation=True),
        embedding=EmbeddingConfig(size=3, identify_steps=192, fit_steps=16),
    )


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture
def key() -> jax.Array:
    return jax.random.key(0)


@pytest.fixture(scope="session")
def finished_run(tiny_config, tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    loop.train(tiny_config, folder)
    return folder


@pytest.fixture(scope="session")
def tiny_arms() -> Config:
    """DDPG on 4 arms of two types, small enough to train in seconds."""
    return Config(
        name="arms",
        task="reacher",
        algorithm="ddpg",
        encoding="chain_fk",
        total_env_steps=320,
        eval_every=80,
        num_envs=4,
        pool=ArmPoolConfig(types=("A", "I"), left_out=("H",), robots_per_type=2, heldout_per_type=2),
        env=ArmConfig(episode_length=10),
        ddpg=DDPGConfig(hidden_sizes=(8, 8), buffer_episodes=10, warmup_episodes=8, updates_per_iteration=5, batch_size=16),
    )


@pytest.fixture(scope="session")
def finished_arms(tiny_arms, tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "arms"
    loop.train(tiny_arms, folder)
    return folder

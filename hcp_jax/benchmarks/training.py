"""Whole training beside well-known peers, on the same robots and with as many gradient samples per control step.

| row | what is timed |
|---|---|
| `hcp_jax` | our iteration: collecting and learning |
| `sb3-ppo` | Stable-Baselines3's PPO with 8 subprocesses, each one world of our pool (`hcp_jax.gym`) |
| `brax-ppo` | brax's PPO on brax's own hopper, simulated by MJX: one robot, the nearest task that it has |
| `sb3-her` | Stable-Baselines3's DDPG with HerReplayBuffer on one world of our pool |

Gradient samples are steps drawn for an update, counted each time: epochs of PPO, updates times batch size per collected step of
DDPG. The peers need the extra `bench`.
"""

import dataclasses
import importlib.util
import time
from collections.abc import Callable, Iterator, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax import gym
from hcp_jax.benchmarks.learner import benchmark_learner
from hcp_jax.config import Config
from hcp_jax.errors import UserError
from hcp_jax.experiment.arm import ArmExperiment
from hcp_jax.experiment.build import make_experiment

PEERS = {"hopper": ("sb3-ppo", "brax-ppo"), "reacher": ("sb3-her",), "peg_insertion": ("sb3-her",)}
SUCCESS_ROWS = ("hcp_jax", "sb3-her")
NUM_SUBPROCESSES = 8
_SB3_UNROLL, _SB3_BATCH = 2048, 64  # Stable-Baselines3's defaults
_BRAX_NUM_ENVS, _BRAX_UNROLL = 128, 32


def samples_per_step(config: Config) -> float:
    """Gradient samples for each collected control step."""
    if config.task == "hopper":
        return float(config.ppo.num_epochs)
    return config.ddpg.updates_per_iteration * config.ddpg.batch_size / config.steps_per_iteration


def benchmark_training(config: Config, rows: Sequence[str], seconds: float) -> Iterator[dict]:
    """Times control steps of training.

    Args:
        config: the experiment; peers get its robots, networks' widths and gradient samples per step, otherwise their defaults.
        rows: `hcp_jax`, and names out of `PEERS` of the task.
        seconds: shortest time of one measurement of ours; Stable-Baselines3 learns for at least that long, brax for three
            iterations.

    Yields:
        name, task, samples_per_step, control_steps_per_s.

    Raises:
        UserError: a peer is not installed; nothing was measured.
    """
    check_installed(rows)
    for name in rows:
        if name == "hcp_jax":
            speed = benchmark_learner(config, seconds)[0]["control_steps_per_s"]
        else:
            time_peer = {"sb3-ppo": time_sb3_ppo, "brax-ppo": time_brax_ppo, "sb3-her": time_sb3_her}[name]
            speed = time_peer(config, seconds)
        per_step = round(samples_per_step(config), 3)
        yield {"name": name, "task": config.task, "samples_per_step": per_step, "control_steps_per_s": round(speed, 1)}


def check_installed(peers: Sequence[str]) -> None:
    """Raises UserError for a peer whose package is missing."""
    for name in peers:
        if name.startswith("sb3") and importlib.util.find_spec("stable_baselines3") is None:
            raise UserError(f"--rows {name}: needs the extra bench: pip install stable-baselines3")


def time_sb3_ppo(config: Config, seconds: float) -> float:
    """Control steps per second of Stable-Baselines3's PPO."""
    from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.vec_env import SubprocVecEnv  # pyright: ignore[reportMissingImports]

    worlds = SubprocVecEnv([lambda: gym.make_env(config)] * NUM_SUBPROCESSES, start_method="spawn")
    try:
        widths = list(config.ppo.hidden_sizes)
        model = PPO(
            "MlpPolicy",
            worlds,
            n_steps=_SB3_UNROLL,
            batch_size=_SB3_BATCH,
            n_epochs=config.ppo.num_epochs,
            policy_kwargs={"net_arch": {"pi": widths, "vf": widths}},
            device="cpu",
            seed=config.seed,
        )
        return time_learning(model, NUM_SUBPROCESSES * _SB3_UNROLL, seconds)
    finally:
        worlds.close()


def time_sb3_her(config: Config, seconds: float) -> float:
    """Control steps per second of Stable-Baselines3's DDPG with HerReplayBuffer."""
    model = make_sb3_her(config, equal_samples=True)
    episode = model.get_env().envs[0].unwrapped.episode_length
    model.learn(config.ddpg.warmup_episodes * episode)
    return time_learning(model, 5 * episode, seconds)


def make_sb3_her(config: Config, equal_samples: bool):
    """A Stable-Baselines3 agent with our networks' widths: with our gradient samples per step, or with its own defaults."""
    from stable_baselines3 import DDPG, HerReplayBuffer  # pyright: ignore[reportMissingImports]

    env = gym.make_env(config)
    settings = {}
    if equal_samples:
        updates = max(1, round(samples_per_step(config) * env.episode_length / config.ddpg.batch_size))
        settings = {"batch_size": config.ddpg.batch_size, "train_freq": (1, "episode"), "gradient_steps": updates}
    return DDPG(
        "MultiInputPolicy",
        env,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future", "copy_info_dict": True},
        learning_starts=config.ddpg.warmup_episodes * env.episode_length,
        policy_kwargs={"net_arch": list(config.ddpg.hidden_sizes)},
        device="cpu",
        seed=config.seed,
        **settings,
    )


def time_learning(model, num_steps: int, seconds: float) -> float:
    """Control steps per second of a Stable-Baselines3 agent that learns `num_steps` at a time."""
    model.learn(num_steps, reset_num_timesteps=False)
    before, start = model.num_timesteps, time.perf_counter()
    while (elapsed := time.perf_counter() - start) < seconds:
        model.learn(num_steps, reset_num_timesteps=False)
    return (model.num_timesteps - before) / elapsed


def time_brax_ppo(config: Config, _seconds: float) -> float:
    """Control steps per second of brax's PPO on its hopper, without compilation."""
    from brax import envs
    from brax.training.agents.ppo import train as ppo

    # brax 0.14 calls this, which jax 0.10 has taken out.
    jax.device_put_replicated = lambda tree, devices: jax.tree.map(lambda leaf: jnp.stack([leaf] * len(devices)), tree)
    per_iteration = _BRAX_NUM_ENVS * _BRAX_UNROLL
    speeds: list[float] = []
    ppo.train(
        environment=envs.get_environment("hopper", backend="mjx"),
        num_timesteps=3 * per_iteration,
        episode_length=1000,
        num_envs=_BRAX_NUM_ENVS,
        batch_size=_BRAX_NUM_ENVS,
        unroll_length=_BRAX_UNROLL,
        num_minibatches=1,
        num_updates_per_batch=config.ppo.num_epochs,
        num_evals=4,
        run_evals=False,
        progress_fn=lambda _, metrics: speeds.append(float(metrics["training/sps"])) if "training/sps" in metrics else None,
    )
    return speeds[-1]  # the first one compiles


def benchmark_success(config: Config, rows: Sequence[str], target: float, limit: float) -> Iterator[dict]:
    """Times training until held-out robots of the training types succeed, everything included: compilation and evaluations.

    Args:
        config: a goal task's experiment.
        rows: names out of `SUCCESS_ROWS`, `sb3-her` with its defaults.
        target: success [%].
        limit: seconds after which a row is given up.

    Yields:
        name, task, target, seconds, env_steps, success (the last one measured), reached.

    Raises:
        UserError: a peer is not installed; nothing was measured.
    """
    check_installed(rows)
    for name in rows:
        yield time_to_success(config, name, target, limit)


def time_to_success(config: Config, name: str, target: float, limit: float) -> dict:
    """A row of `benchmark_success`."""
    start = time.perf_counter()
    learn = start_ours(config) if name == "hcp_jax" else start_sb3_her(config)
    env_steps, success = learn()
    while success < target and time.perf_counter() - start < limit:
        env_steps, success = learn()
    return {
        "name": name,
        "task": config.task,
        "target": target,
        "seconds": round(time.perf_counter() - start, 1),
        "env_steps": env_steps,
        "success": round(success, 2),
        "reached": success >= target,
    }


def start_ours(config: Config) -> Callable[[], tuple[int, float]]:
    """A function that trains until the config's next evaluation and returns control steps so far and success in percent."""
    run = make_experiment(config)
    assert isinstance(run, ArmExperiment)
    state, iterations = run.init_state(), max(1, round(config.eval_every / config.steps_per_iteration))

    def learn() -> tuple[int, float]:
        nonlocal state
        state = run.learner.train(state, jnp.int32(iterations))
        success = run.evaluate(state)[0]["train_types_success"]
        return int(state.iteration) * config.steps_per_iteration, float(success or 0.0)

    return learn


def start_sb3_her(config: Config, num_steps: int = 10_000) -> Callable[[], tuple[int, float]]:
    """The same for Stable-Baselines3's agent with its defaults, evaluated every `num_steps`."""
    model = make_sb3_her(config, equal_samples=False)
    of_training_types = dataclasses.replace(config, pool=dataclasses.replace(config.pool, left_out=()))
    worlds = gym.make_vector_env(of_training_types, heldout=True)
    assert isinstance(worlds, gym.GoalVectorEnv)

    def learn() -> tuple[int, float]:
        model.learn(num_steps, reset_num_timesteps=False)
        return model.num_timesteps, 100.0 * play_once(worlds, lambda obs: model.predict(obs, deterministic=True)[0])

    return learn


def play_once(worlds: gym.GoalVectorEnv, policy: Callable) -> float:
    """Share of the worlds' first episodes that succeed."""
    obs, _ = worlds.reset(seed=0)
    ended, succeeded = np.zeros(worlds.num_envs, bool), np.zeros(worlds.num_envs, bool)
    while not ended.all():
        obs, _, terminated, truncated, infos = worlds.step(jax.tree.map(np.asarray, policy(obs)))
        succeeded |= ~ended & infos["is_success"]
        ended |= terminated | truncated
    return float(succeeded.mean())

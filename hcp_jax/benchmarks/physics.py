"""Steps per second of every engine behind `hcp_jax.physics`, beside bare MuJoCo, for batches of robots of one pool.

| row | what is timed |
|---|---|
| `mj_step` | a Python loop over robots and substeps, one thread |
| `mujoco.batch` | MuJoCo's own thread pool on all cores, given its controls once, an MjModel per robot |
| `mujoco.batch.expand` | the same with one MjModel, expanded where the robots differ: the bound of `native` |
| `native`, `mjx-warp`, `mjx-jax` | the jitted environment on that engine, with random actions |
| `rollout` | the same on the default engine, with the experiment's policy in the loop |
"""

import functools
import statistics
import time
from collections.abc import Callable, Iterator, Sequence

import jax
import jax.numpy as jnp
import mujoco
import mujoco.batch
import numpy as np

from hcp_jax.config import Config
from hcp_jax.devices import count_cores, split_rows
from hcp_jax.experiment.arm import ArmExperiment
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import HopperExperiment, train_v_h
from hcp_jax.physics.base import MJ_INTEGRATORS
from hcp_jax.physics.native import get_batch_fields

ENGINES = ("native", "mjx-warp", "mjx-jax")
ROWS = ("mj_step", "mujoco.batch", "mujoco.batch.expand", *ENGINES, "rollout")
REPEATS = 3
# Fused as XLA does by default on a CPU, the kinematics of a chain of seven joints take 5 s instead of 1 ms (jax 0.10, 8 arms).
_MJX_JAX_ON_CPU = {"xla_cpu_use_fusion_emitters": False}


def benchmark_physics(config: Config, batches: list[int], rows: Sequence[str], seconds: float) -> Iterator[dict]:
    """Times `rows` out of `ROWS` with each batch of robots of the config's training pool, repeated where it is smaller.

    Args:
        config: the experiment whose robots, task and policy are timed.
        batches: numbers of environments.
        rows: names out of `ROWS`.
        seconds: shortest time of one measurement; the median of three counts.

    Yields:
        name, task, num_envs, control_steps_per_s, physics_steps_per_s, num_control_steps (of one measurement).
    """
    run = make_experiment(config)
    assert isinstance(run, (ArmExperiment, HopperExperiment))
    substeps = run.make_env(run.train_pool).task.num_substeps
    for num_envs in batches:
        for name in rows:
            if name == "mj_step":
                steps = make_mj_step(run, num_envs)
            elif name.startswith("mujoco.batch"):
                steps = make_batch(run, num_envs, name.endswith("expand"))
            else:
                with_policy = name == "rollout"
                steps = make_rollout(run, run.physics if with_policy else name, num_envs, with_policy)
            speed, count = time_steps(steps, seconds)
            yield {
                "name": name,
                "task": config.task,
                "num_envs": num_envs,
                "control_steps_per_s": round(speed * num_envs, 1),
                "physics_steps_per_s": round(speed * num_envs * substeps, 1),
                "num_control_steps": count,
            }


def time_steps(steps: Callable[[int], None], seconds: float) -> tuple[float, int]:
    """Batched control steps per second of `steps(n)`, and the n that takes at least `seconds`."""
    for _ in range(2):
        steps(1)  # compiles, and once more for arrays that are placed as a first call returned them
    count, elapsed = 1, time_call(steps, 1)
    while elapsed < seconds:
        count = max(2 * count, int(1.2 * count * seconds / max(elapsed, 1e-3)))
        elapsed = time_call(steps, count)
    times = [elapsed, *(time_call(steps, count) for _ in range(REPEATS - 1))]
    return count / statistics.median(times), count


def time_call(steps: Callable[[int], None], count: int) -> float:
    start = time.perf_counter()
    steps(count)
    return time.perf_counter() - start


def make_rollout(run: ArmExperiment | HopperExperiment, engine: str, num_envs: int, with_policy: bool) -> Callable[[int], None]:
    """n control steps of the jitted environment, with the policy's actions or random ones."""
    env, index = run.make_env(run.train_pool, engine), jnp.arange(num_envs, dtype=jnp.int32) % run.train_pool.num_robots
    policy = make_policy(run) if with_policy else None

    options = _MJX_JAX_ON_CPU if engine == "mjx-jax" and jax.default_backend() == "cpu" else None

    @functools.partial(jax.jit, compiler_options=options)
    def play(state, key, count):
        def step(_, carry):
            state, key = carry
            key, key_action = jax.random.split(key)
            if policy is None:
                action = jax.random.uniform(key_action, (num_envs, env.action_size), minval=-1.0, maxval=1.0)
            else:
                action = policy(state)
            return split_rows(env.step(state, action)[0]), key

        return jax.lax.fori_loop(0, count, step, (state, key))

    carry = (jax.jit(env.reset)(jax.random.key(0), index), jax.random.key(1))

    def steps(count: int) -> None:
        nonlocal carry
        carry = jax.block_until_ready(play(*carry, count))

    return steps


def make_policy(run: ArmExperiment | HopperExperiment) -> Callable:
    """The experiment's policy, not trained: environment state -> actions [B, A]."""
    state = run.init_state()
    if isinstance(run, HopperExperiment):
        v_h = train_v_h(run, state.params)
        return lambda s: run.learner.mean_action(state.params["network"], state.obs_statistics, s.obs, v_h[s.index])
    learner = run.learner
    return lambda s: learner.mean_action(state.params, state.statistics, learner.conditioning, s.index, s.obs, s.desired_goal)


def make_models(run: ArmExperiment | HopperExperiment, num_envs: int) -> tuple[list[mujoco.MjModel], np.ndarray, int]:
    """Models of the batch's robots at the environment's integrator and step, their initial angles, and substeps."""
    env = run.make_env(run.train_pool)
    rows = np.arange(num_envs) % run.train_pool.num_robots
    state = env.reset(jax.random.key(0), jnp.asarray(rows, jnp.int32))
    models = run.train_pool.subset(np.unique(rows)).models()
    for model in models:
        model.opt.timestep = env.task.sim_dt
        model.opt.integrator = MJ_INTEGRATORS[run.config.env.integrator]
    return [models[row] for row in rows], np.asarray(state.physics.qpos, np.float64), env.task.num_substeps


def make_batch(run: ArmExperiment | HopperExperiment, num_envs: int, expand: bool) -> Callable[[int], None]:
    """n control steps of `mujoco.batch` on all cores, on a model per robot or on one whose fields are expanded."""
    models, qpos, substeps = make_models(run, num_envs)
    batch = mujoco.batch.Batch(models[0], num_envs, count_cores())
    if expand:
        rows = np.arange(num_envs) % run.train_pool.num_robots
        for name, values in get_batch_fields(run.train_pool, models[0]).items():
            batch.expand(name)[:] = values[rows]
    else:
        batch.set_models(models)
    batch.qpos[:] = qpos
    batch.ctrl[:] = np.random.default_rng(0).uniform(-1.0, 1.0, batch.ctrl.shape)

    def steps(count: int) -> None:
        for _ in range(count):
            batch.step(nstep=substeps)

    return steps


def make_mj_step(run: ArmExperiment | HopperExperiment, num_envs: int) -> Callable[[int], None]:
    """n control steps of a Python loop over the robots, on one thread."""
    models, qpos, substeps = make_models(run, num_envs)
    rng = np.random.default_rng(0)
    worlds = []
    for model, angles in zip(models, qpos, strict=True):
        data = mujoco.MjData(model)
        data.qpos[:] = angles
        data.ctrl[:] = rng.uniform(-1.0, 1.0, model.nu)
        worlds.append((model, data))

    def steps(count: int) -> None:
        for _ in range(count):
            for model, data in worlds:
                for _ in range(substeps):
                    mujoco.mj_step(model, data)

    return steps

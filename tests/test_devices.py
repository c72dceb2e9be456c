"""On 2 and 4 devices training comes out as on one, and each robot is stepped once. Each count is a process of its own.

`pytest -m slow tests/test_devices.py`
"""

import json
import os
import subprocess
import sys

import jax
import numpy as np
import pytest

from hcp_jax.devices import options_for_batch

SCRIPT = """
import json, sys
import jax, jax.numpy as jnp, numpy as np
from hcp_jax import presets
from hcp_jax.config import ArmConfig, ArmPoolConfig, DDPGConfig, EmbeddingConfig, HopperConfig, HopperPoolConfig, PPOConfig
from hcp_jax.devices import get_mesh
from hcp_jax.experiment.build import make_experiment

HOPPER = presets.hopper(
    "a", "embedding", num_envs=8, total_env_steps=512,
    pool=HopperPoolConfig(num_robots=8, num_heldout=4), env=HopperConfig(episode_length=24, integrator="euler"),
    ppo=PPOConfig(unroll_length=8, num_minibatches=2, num_epochs=2, hidden_sizes=(8, 8), normalize_observation=True),
    embedding=EmbeddingConfig(size=3, identify_steps=0, fit_steps=0),
)
ARMS = presets.arm(
    "a", "reacher", "chain_fk", num_envs=8, total_env_steps=640,
    pool=ArmPoolConfig(("A", "I"), (), 4, 2), env=ArmConfig(episode_length=10),
    ddpg=DDPGConfig(
        hidden_sizes=(8, 8), batch_size=16, updates_per_iteration=5, buffer_episodes=16, warmup_episodes=8, n_step=3
    ),
)
results = {"devices": get_mesh().size}
RUNS = {"hopper": (HOPPER, "native"), "arms": (ARMS, "native"), "mjx": (HOPPER, "mjx-jax")}
for name in sys.argv[1:]:
    config, physics = RUNS[name]
    run = make_experiment(config, physics)
    stepped = []
    if physics == "native":
        engine = run.learner.env.physics
        host_step = engine._host_step
        engine._host_step = lambda n, ids, *rest: (stepped.append(len(ids)), host_step(n, ids, *rest))[1]
    state = run.learner.train(run.init_state(), jnp.int32(1 if name == "mjx" else 3))
    if name == "arms":
        results["batch_devices"] = len(state.replay.episodes.obs.sharding.device_set)
    else:
        shards = state.env_state.obs.addressable_shards
        results["shards"] = [shard.data.shape[0] for shard in shards]
    leaves = [np.asarray(leaf, np.float64).ravel() for leaf in jax.tree.leaves(state.params)]
    results[name] = np.concatenate(leaves).tolist()
    results[name + "_stepped"] = stepped  # worlds of each call
json.dump(results, sys.stdout)
"""


def test_a_cpu_multiplies_small_batches_on_one_thread_and_no_other_device_is_told_so(monkeypatch):
    assert options_for_batch(128) == {"xla_cpu_multi_thread_eigen": False}
    assert options_for_batch(1024) is None
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert options_for_batch(128) is None


def train_on(num_devices: int, names: tuple[str, ...]) -> dict:
    flags = {"XLA_FLAGS": f"--xla_force_host_platform_device_count={num_devices}", "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", SCRIPT, *names]
    done = subprocess.run(command, env=os.environ | flags, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(("num_devices", "names"), [(2, ("arms",)), (4, ("hopper", "arms", "mjx"))])
def test_training_on_several_devices_comes_out_as_on_one(num_devices, names):
    on_one, on_many = (train_on(count, names) for count in (1, num_devices))
    assert (on_one["devices"], on_many["devices"]) == (1, num_devices)
    for name in names:
        np.testing.assert_allclose(on_many[name], on_one[name], atol=2e-4, err_msg=name)
        if name != "mjx":
            assert set(on_one[f"{name}_stepped"]) == {8}
            assert set(on_many[f"{name}_stepped"]) == {8 // num_devices}  # each device steps its own
            assert sum(on_many[f"{name}_stepped"]) == sum(on_one[f"{name}_stepped"])
    if "hopper" in names:
        assert on_many["shards"] == [8 // num_devices] * num_devices
    if "arms" in names:
        assert on_many["batch_devices"] == num_devices

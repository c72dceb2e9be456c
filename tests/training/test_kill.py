"""`kill -9` at arbitrary moments, then `--resume`. Run with: pytest -m slow tests/training/test_kill.py"""

import dataclasses
import pathlib
import random
import subprocess
import sys
import time

import jax
import numpy as np
import pytest

from hcp_jax.config import to_dict
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.checkpoint import Checkpoints
from hcp_jax.training.run_folder import read_config

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["hopper", "arms"])
def experiment(request, tiny_config, tiny_arms, tmp_path_factory) -> pathlib.Path:
    """A run of about ten seconds after start-up, with 20 evaluations."""
    config = tiny_config if request.param == "hopper" else tiny_arms
    batch = config.batch_size
    config = dataclasses.replace(config, total_env_steps=2000 * batch, eval_every=100 * batch)
    path = tmp_path_factory.mktemp("experiment") / "experiment.py"
    path.write_text(
        f"from hcp_jax.config import Config, from_dict\ndef get_config():\n    return from_dict(Config, {to_dict(config)!r})\n"
    )
    return path


def command(experiment: pathlib.Path, out: pathlib.Path, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "hcp_jax.train", "--config", str(experiment), "--out", str(out), *arguments]


def final_arrays(folder: pathlib.Path):
    """The whole state, random keys as numbers."""
    template = make_experiment(read_config(folder)).init_state()
    state = Checkpoints(folder / "checkpoints", read_only=True).restore(template)[1]
    return jax.tree.map(lambda leaf: jax.random.key_data(leaf) if is_key(leaf) else leaf, state)


def is_key(leaf) -> bool:
    return isinstance(leaf, jax.Array) and jax.dtypes.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def test_a_run_killed_three_times_ends_with_the_same_metrics_and_state_bit_for_bit(experiment, tmp_path):
    subprocess.run(command(experiment, tmp_path / "whole"), check=True, capture_output=True)
    out = tmp_path / "killed"
    moments = random.Random(0)
    kills = 0
    while kills < 3:
        resume = ["--resume"] if (out / "config.json").exists() else []
        process = subprocess.Popen(command(experiment, out, *resume), stdout=subprocess.PIPE, text=True)
        for line in process.stdout:
            if "steps/s" in line:
                break
        time.sleep(moments.uniform(0.0, 3.0))
        if process.poll() is None:
            process.kill()
            kills += 1
        process.wait()
    subprocess.run(command(experiment, out, "--resume"), check=True, capture_output=True)
    assert (out / "metrics.csv").read_bytes() == (tmp_path / "whole" / "metrics.csv").read_bytes()
    jax.tree.map(np.testing.assert_array_equal, final_arrays(out), final_arrays(tmp_path / "whole"))

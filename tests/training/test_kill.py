"""`kill -9` at arbitrary moments, then `--resume`. Run with: pytest -m slow tests/training/test_kill.py"""

import dataclasses
import pathlib
import random
import subprocess
import sys
import time

import pytest

from hcp_jax.config import to_dict

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def experiment(tiny_config, tmp_path_factory) -> pathlib.Path:
    """A run of about ten seconds after start-up, with 20 evaluations."""
    config = dataclasses.replace(tiny_config, total_env_steps=64 * 2000, eval_every=64 * 100)
    path = tmp_path_factory.mktemp("experiment") / "experiment.py"
    path.write_text(
        f"from hcp_jax.config import Config, from_dict\ndef get_config():\n    return from_dict(Config, {to_dict(config)!r})\n"
    )
    return path


def command(experiment: pathlib.Path, out: pathlib.Path, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "hcp_jax.train", "--config", str(experiment), "--out", str(out), *arguments]


def test_a_run_killed_three_times_ends_with_the_same_metrics_bit_for_bit(experiment, tmp_path):
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

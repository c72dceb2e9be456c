"""A sweep on a local Ray cluster of two workers, one of which is killed. Run with: pytest -m slow tests/faults"""

import dataclasses
import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest

from hcp_jax.config import Config, to_dict
from hcp_jax.training.checkpoint import Checkpoints

pytest.importorskip("ray")
pytestmark = pytest.mark.slow


def write_list(folder: pathlib.Path, configs: list[Config]) -> pathlib.Path:
    path = folder / "list.py"
    values = [to_dict(config) for config in configs]
    path.write_text(
        "from hcp_jax.config import Config, from_dict\n"
        f"def get_configs():\n    return [from_dict(Config, values) for values in {values!r}]\n"
    )
    return path


def sweep(path: pathlib.Path, out: pathlib.Path) -> list[str]:
    return [sys.executable, "-m", "hcp_jax.sweep", str(path), "--out", str(out), "--ray", "local", "--seeds", "2"]


def test_a_run_whose_worker_is_killed_goes_on_from_its_checkpoint_and_the_table_is_whole(tiny_config, tmp_path):
    batch = tiny_config.steps_per_iteration
    config = dataclasses.replace(tiny_config, total_env_steps=3000 * batch, eval_every=100 * batch)
    path, out = write_list(tmp_path, [config]), tmp_path / "runs"
    process = subprocess.Popen(sweep(path, out), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    victim = out / "tiny_s0"
    while not (victim / "checkpoints").exists() or not Checkpoints(victim / "checkpoints", read_only=True).iterations():
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.2)
    os.kill(int((victim / ".lock").read_text()), signal.SIGKILL)
    output, _ = process.communicate(timeout=600)
    assert process.returncode == 0, output
    assert "resuming at" in output
    rows = json.loads((out / "summary.json").read_text())
    assert [(row["name"], row["seeds"]) for row in rows] == [("tiny", [0, 1])]


def test_a_run_that_fails_does_not_keep_the_others_from_ending(tiny_config, tmp_path):
    taken = dataclasses.replace(tiny_config, name="taken")
    path, out = write_list(tmp_path, [taken, tiny_config]), tmp_path / "runs"
    (out / "taken_s0").mkdir(parents=True)
    (out / "taken_s0" / "file").write_text("somebody's")
    done = subprocess.run(sweep(path, out), capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "1 of 4 runs failed" in done.stderr
    assert "already exists" in done.stdout
    assert (out / "tiny_s1" / "metrics.csv").exists()

"""Two processes train together as one process alone does, and the first of them alone writes.

`pytest -n 0 -m slow tests/test_processes.py`
"""

import os
import pathlib
import socket
import subprocess
import sys

import pytest

from hcp_jax.config import Config, to_dict
from hcp_jax.training.metrics import read_rows

pytestmark = pytest.mark.slow

PATIENCE = 1800.0  # [s]


def write_experiment(config: Config, folder: pathlib.Path) -> pathlib.Path:
    path = folder / "experiment.py"
    path.write_text(
        f"from hcp_jax.config import Config, from_dict\ndef get_config():\n    return from_dict(Config, {to_dict(config)!r})\n"
    )
    return path


def start(experiment: pathlib.Path, out: pathlib.Path, num_processes: int, *arguments: str) -> list[subprocess.Popen]:
    """One process, or several that know each other by the environment."""
    with socket.socket() as free:
        free.bind(("localhost", 0))
        address = f"localhost:{free.getsockname()[1]}"
    processes = []
    for number in range(num_processes):
        command = [sys.executable, "-m", "hcp_jax.train", "--config", str(experiment), "--out", str(out), *arguments]
        names = {"JAX_COORDINATOR_ADDRESS": address, "JAX_NUM_PROCESSES": str(num_processes), "JAX_PROCESS_ID": str(number)}
        if num_processes > 1:
            command.append("--distributed")
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        processes.append(subprocess.Popen(command, env=os.environ | names, **pipes))
    return processes


def train(experiment: pathlib.Path, out: pathlib.Path, num_processes: int, *arguments: str) -> list[str]:
    """What each process said."""
    processes = start(experiment, out, num_processes, *arguments)
    outputs = [process.communicate(timeout=PATIENCE)[0] for process in processes]
    for process, output in zip(processes, outputs, strict=True):
        assert process.returncode == 0, output[-3000:]
    return outputs


def assert_same_metrics(out: pathlib.Path, alone: pathlib.Path) -> None:
    rows, expected = read_rows(out / "metrics.csv"), read_rows(alone / "metrics.csv")
    assert [row["env_steps"] for row in rows] == [row["env_steps"] for row in expected]
    for row, other in zip(rows, expected, strict=True):
        for name, value in other.items():
            assert float(row[name] or "nan") == pytest.approx(float(value or "nan"), rel=5e-3, abs=5e-3, nan_ok=True), name


@pytest.mark.parametrize("kind", ["arms", "hopper"])
def test_two_processes_learn_what_one_does_and_resume_after_an_interruption(kind, tiny_config, tiny_arms, tmp_path):
    experiment = write_experiment(tiny_arms if kind == "arms" else tiny_config, tmp_path)
    alone, together = tmp_path / "alone", tmp_path / "together"
    train(experiment, alone, 1)
    outputs = train(experiment, together, 2)
    assert "of 2 processes" in outputs[0]
    assert "steps" not in outputs[1]
    assert_same_metrics(together, alone)
    steps = int(read_rows(alone / "metrics.csv")[-1]["env_steps"])
    outputs = train(experiment, together, 2, "--resume", f"--config.total_env_steps={2 * steps}")
    assert f"resuming at {steps:,} steps" in outputs[0]
    train(experiment, alone, 1, "--resume", f"--config.total_env_steps={2 * steps}")
    assert_same_metrics(together, alone)

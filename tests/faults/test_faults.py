"""What can happen to a run over night, and what is lost: nothing but the work since the last checkpoint, and not the result.

`pytest -n 0 -m slow -s tests/faults`; `-s` shows what each kill lost.
"""

import dataclasses
import pathlib
import random
import re
import signal
import subprocess
import sys
import time

import jax
import numpy as np
import pytest

from hcp_jax.config import to_dict
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training import loop
from hcp_jax.training.checkpoint import Checkpoints
from hcp_jax.training.metrics import read_rows
from hcp_jax.training.run_folder import read_config

pytestmark = pytest.mark.slow

NUM_KILLS = 15  # of each experiment
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
DISK_BYTES = 12 << 20
PATIENCE = 1800.0  # [s] for a process to end by itself, on a machine that others use too


@pytest.fixture(scope="module", params=["hopper", "arms"])
def experiment(request, tiny_config, tiny_arms, tmp_path_factory) -> pathlib.Path:
    """A run of some seconds after start-up, with 40 evaluations."""
    config = tiny_config if request.param == "hopper" else tiny_arms
    batch = config.steps_per_iteration
    config = dataclasses.replace(config, total_env_steps=4000 * batch, eval_every=100 * batch)
    path = tmp_path_factory.mktemp("experiment") / "experiment.py"
    path.write_text(
        f"from hcp_jax.config import Config, from_dict\ndef get_config():\n    return from_dict(Config, {to_dict(config)!r})\n"
    )
    return path


@pytest.fixture(scope="module")
def whole(experiment, tmp_path_factory) -> pathlib.Path:
    """The run that nothing happened to."""
    out = tmp_path_factory.mktemp("whole") / "run"
    subprocess.run(command(experiment, out), check=True, capture_output=True)
    return out


def command(experiment: pathlib.Path, out: pathlib.Path, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "hcp_jax.train", "--config", str(experiment), "--out", str(out), *arguments]


def resume_to_the_end(experiment: pathlib.Path, out: pathlib.Path) -> str:
    done = subprocess.run(command(experiment, out, "--resume"), check=True, capture_output=True, text=True)
    return done.stdout


def start(experiment: pathlib.Path, out: pathlib.Path) -> subprocess.Popen:
    resume = ["--resume"] if (out / "config.json").exists() else []
    return subprocess.Popen(
        command(experiment, out, *resume), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1
    )


def read_until(process: subprocess.Popen, pattern: str) -> re.Match | None:
    """The first line with `pattern`, or None where the process ends before it."""
    assert process.stdout is not None
    return next((found for line in process.stdout if (found := re.search(pattern, line))), None)


def newest_iteration(out: pathlib.Path) -> int:
    folder = out / "checkpoints"
    return max(Checkpoints(folder, read_only=True).iterations(), default=0) if folder.exists() else 0


def final_arrays(folder: pathlib.Path):
    """The whole state, random keys as numbers."""
    template = make_experiment(read_config(folder)).init_state()
    state = Checkpoints(folder / "checkpoints", read_only=True).restore(template)[1]
    return jax.tree.map(lambda leaf: jax.random.key_data(leaf) if is_key(leaf) else leaf, state)


def is_key(leaf) -> bool:
    return isinstance(leaf, jax.Array) and jax.dtypes.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def assert_same_result(out: pathlib.Path, whole: pathlib.Path) -> None:
    """Metrics and state, bit for bit."""
    assert (out / "metrics.csv").read_bytes() == (whole / "metrics.csv").read_bytes()
    jax.tree.map(np.testing.assert_array_equal, final_arrays(out), final_arrays(whole))


def test_random_kills_lose_no_checkpoint_and_change_no_result(experiment, whole, tmp_path):
    out, draw = tmp_path / "killed", random.Random(0)
    batch = read_config(whole).steps_per_iteration
    kills = 0
    while kills < NUM_KILLS:
        before = newest_iteration(out)
        process = start(experiment, out)
        resumed = read_until(process, r"resuming at ([\d,]+) steps|compiling the training step")
        if resumed and resumed[1]:
            assert int(resumed[1].replace(",", "")) == before * batch, "a checkpoint was lost"
            read_until(process, "compiling the training step")
        time.sleep(draw.uniform(0.0, 4.0))  # from the compilation to some evaluations later
        name = draw.choice(SIGNALS)
        if process.poll() is None:
            process.send_signal(name)
            kills += 1
        process.communicate(timeout=PATIENCE)
        after = newest_iteration(out)
        print(f"{whole.parent.name} {kills:>3} {name.name:>8}: checkpoint before {before:>5}, after {after:>5}", flush=True)
        assert after >= before
    resume_to_the_end(experiment, out)
    assert_same_result(out, whole)


def test_a_truncated_newest_checkpoint_is_passed_over_and_changes_no_result(experiment, whole, tmp_path):
    out = tmp_path / "truncated"
    process = start(experiment, out)
    for _ in range(3):
        read_until(process, "held")
    process.kill()
    process.communicate()
    newest = out / "checkpoints" / "newest" / str(newest_iteration(out))
    for path in newest.rglob("*"):
        if path.is_file() and path.stat().st_size > 100:
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert "cannot be read and is passed over" in resume_to_the_end(experiment, out)
    assert_same_result(out, whole)


def test_a_second_writer_is_refused_and_the_first_is_not_disturbed(experiment, whole, tmp_path):
    out = tmp_path / "shared"
    first = start(experiment, out)
    read_until(first, "compiling the training step")
    second = subprocess.run(command(experiment, out, "--resume"), capture_output=True, text=True, check=False)
    assert second.returncode == 2
    assert "is training there" in second.stderr
    assert second.stderr.count("\n") == 1
    first.communicate()
    assert first.returncode == 0
    assert_same_result(out, whole)


def test_a_full_disk_ends_the_run_with_its_name_and_keeps_the_checkpoints_it_has(experiment, whole, tmp_path):
    mount = tmp_path / "disk"
    mount.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", str(mount)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("needs the right to mount a tmpfs")
    try:
        out, ballast = mount / "run", mount / "ballast"
        with ballast.open("wb", buffering=0) as file:  # takes what is left
            process = start(experiment, out)
            read_until(process, "held")
            read_until(process, "held")
            try:
                while True:
                    file.write(b"0" * 4096)
            except OSError:
                pass
        kept = newest_iteration(out)
        output, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 1, output
        # Orbax's own threads may print tracebacks before that ("Event loop is closed").
        assert "No space left on device" in output.strip().splitlines()[-1]
        assert newest_iteration(out) >= kept > 0
        ballast.unlink()
        resume_to_the_end(experiment, out)
        assert_same_result(out, whole)
    finally:
        subprocess.run(["umount", "-l", str(mount)], check=True)


@pytest.mark.parametrize("kind", ["hopper", "arms"])
def test_nan_from_the_physics_of_one_robot_ends_its_episodes_and_nothing_else(kind, tiny_config, tiny_arms, tmp_path):
    config = tiny_config if kind == "hopper" else tiny_arms
    run = make_experiment(config, "native")
    engine, broken = run.learner.env.physics, int(run.train_pool.robot_id[0])
    host_step = engine._host_step

    def broken_step(num_substeps, robot_id, *rest):
        qpos, qvel, warmstart, overflow = host_step(num_substeps, robot_id, *rest)
        qpos[robot_id == broken] = np.nan
        return qpos, qvel, warmstart, overflow

    engine._host_step = broken_step
    folder = tmp_path / "run"
    folder.mkdir()
    loop._run(run, run.init_state(), folder, resume=False, interrupt=loop.Interrupt())
    last = read_rows(folder / "metrics.csv")[-1]
    assert int(last["diverged_robots"]) == 1
    assert int(last["diverged_episodes"]) > 0
    assert int(last["skipped_updates"]) == 0
    losses = [float(value) for name, value in last.items() if name.endswith("_loss")]
    assert losses
    assert np.isfinite(losses).all()

import json

import pytest

from hcp_jax import benchmark
from hcp_jax.benchmarks.physics import time_steps

ROWS = ["mj_step", "mujoco.batch", "mujoco.batch.expand", "native", "rollout"]


@pytest.mark.parametrize("task", ["hopper", "reacher"])
def test_every_row_is_timed_with_every_batch(task, tmp_path):
    experiment = tmp_path / "experiment.py"
    size = "pool=HopperPoolConfig(num_robots=4)" if task == "hopper" else "left_out='H', pool=ArmPoolConfig(('I',), (), 2)"
    make = "hopper('a', 'kinematics'" if task == "hopper" else "arm('a', 'reacher', 'chain_fk'"
    experiment.write_text(
        "from hcp_jax import presets\nfrom hcp_jax.config import ArmPoolConfig, HopperPoolConfig\n"
        f"def get_config():\n    return presets.{make}, {size})\n"
    )
    out = tmp_path / "physics.json"
    arguments = ["--config", str(experiment), "--batches", "1", "6", "--rows", *ROWS, "--seconds", "0.01"]
    benchmark.main(["physics", *arguments, "--json", str(out)])
    rows = json.loads(out.read_text())["rows"]
    assert [(row["name"], row["num_envs"]) for row in rows] == [(name, batch) for batch in (1, 6) for name in ROWS]
    substeps = 4 if task == "hopper" else 5
    for row in rows:
        assert row["physics_steps_per_s"] == pytest.approx(substeps * row["control_steps_per_s"], rel=1e-3)


def test_a_measurement_lasts_as_long_as_asked():
    calls = []
    speed, count = time_steps(lambda n: (calls.append(n), [sum(range(1000)) for _ in range(n)]), seconds=0.02)
    assert calls[-3:] == [count] * 3
    assert 0.5 * count / speed < 10 * 0.02
    assert count / speed > 0.01


def test_no_environments_is_refused(capsys):
    with pytest.raises(SystemExit) as exit_info:
        benchmark.main(["physics", "--batches", "0"])
    assert exit_info.value.code == 2
    assert "--batches=0: expected at least 1" in capsys.readouterr().err

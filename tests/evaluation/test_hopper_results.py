import dataclasses
import json

import pytest

from hcp_jax import collect, sweep
from hcp_jax.config import to_dict
from hcp_jax.evaluation.summary import read_curve, steps_to_reach
from hcp_jax.training.metrics import MetricsWriter


@pytest.fixture(scope="module")
def swept(tiny_config, tmp_path_factory):
    """Two tiny experiments with two seeds each."""
    folder = tmp_path_factory.mktemp("sweep")
    configs = [
        dataclasses.replace(tiny_config, name="with", total_env_steps=128),
        dataclasses.replace(tiny_config, name="without", encoding="none", total_env_steps=128),
    ]
    (folder / "list.py").write_text(
        "from hcp_jax.config import Config, from_dict\n"
        f"def get_configs():\n    return [from_dict(Config, values) for values in {[to_dict(c) for c in configs]!r}]\n"
    )
    sweep.main([str(folder / "list.py"), "--seeds", "2", "--out", str(folder / "runs")])
    return folder


def test_a_sweep_runs_every_experiment_with_every_seed_and_sums_up(swept):
    rows = json.loads((swept / "runs" / "summary.json").read_text())
    assert [(row["algorithm"], row["seeds"], row["env_steps"]) for row in rows] == [
        ("HCP-I", [0, 1], 128),
        ("PPO", [0, 1], 128),
    ]
    assert rows[0]["heldout_fitted_return_mean"] is not None
    assert rows[1]["heldout_fitted_return_mean"] is None


def test_a_sweep_skips_what_is_done(swept, capsys):
    before = (swept / "runs" / "with_s1" / "metrics.csv").stat().st_mtime_ns
    sweep.main([str(swept / "list.py"), "--seeds", "2", "--out", str(swept / "runs")])
    assert capsys.readouterr().out.count(": done") == 4
    assert (swept / "runs" / "with_s1" / "metrics.csv").stat().st_mtime_ns == before


def test_collected_results_come_from_the_run_folders(swept):
    collect.main([str(swept / "runs"), "--out", str(swept / "results")])
    assert (swept / "results" / "curves.png").read_bytes().startswith(b"\x89PNG")
    copy = swept / "results" / "runs" / "with_s0" / "metrics.csv"
    assert copy.read_bytes() == (swept / "runs" / "with_s0" / "metrics.csv").read_bytes()
    assert len(json.loads((swept / "results" / "summary.json").read_text())) == 2


def test_collecting_nothing_is_an_error(tmp_path, capsys):
    with pytest.raises(SystemExit) as exit_info:
        collect.main([str(tmp_path), "--out", str(tmp_path / "results")])
    assert exit_info.value.code == 2
    assert "holds no run folders" in capsys.readouterr().err


def test_steps_to_reach_is_the_first_evaluation_at_or_above_the_value(tmp_path):
    writer = MetricsWriter(tmp_path)
    for steps, value in ((10, 1.0), (20, 5.0), (30, 3.0), (40, 6.0)):
        writer.write({"env_steps": steps, "r": value}, {"env_steps": steps})
    writer.close()
    assert read_curve(tmp_path, "r").tolist() == [[10, 1], [20, 5], [30, 3], [40, 6]]
    assert steps_to_reach(tmp_path, "r", 4.0) == 20
    assert steps_to_reach(tmp_path, "r", 7.0) is None

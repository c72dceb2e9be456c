import dataclasses
import json
import shutil

import flax.serialization
import jax
import numpy as np
import pytest

from hcp_jax import collect, sweep
from hcp_jax.config import to_dict
from hcp_jax.evaluation.groups import group_folders
from hcp_jax.evaluation.hopper_results import is_of_embedding, write_finetune
from hcp_jax.evaluation.hopper_sweeps import evaluate_hoppers
from hcp_jax.evaluation.summary import read_curve, read_wall_seconds, steps_to_reach, summarise_runs
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import CheckpointError
from hcp_jax.training.metrics import MetricsWriter


@pytest.fixture(scope="module")
def swept(tiny_config, tmp_path_factory):
    """Two tiny experiments with two seeds each."""
    folder = tmp_path_factory.mktemp("sweep")
    identified = dataclasses.replace(tiny_config.embedding, identify_steps=64)
    configs = [
        dataclasses.replace(tiny_config, name="with", total_env_steps=128, embedding=identified),
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


@pytest.fixture(scope="module")
def collected(swept):
    collect.main([str(swept / "runs"), "--out", str(swept / "results")])


def test_collected_results_come_from_the_run_folders(swept, collected):
    results = swept / "results" / "hopper"
    assert (results / "curves.png").read_bytes().startswith(b"\x89PNG")
    copy = results / "runs" / "with_s0" / "metrics.csv"
    assert copy.read_bytes() == (swept / "runs" / "with_s0" / "metrics.csv").read_bytes()
    assert len(json.loads((results / "summary.json").read_text())) == 2


def test_a_published_policy_earns_what_its_run_earns(swept, collected):
    records = [evaluate_hoppers(folder / "with_s1", 1, 4) for folder in (swept / "runs", swept / "results" / "policies")]
    assert set(records[0]["sets"]) == set(records[1]["sets"]) == {"train", "heldout", "heldout_fitted"}
    for name, one in records[0]["sets"].items():
        assert records[1]["sets"][name] == pytest.approx(one, rel=1e-4)


def test_a_published_policy_has_its_kernels_in_half_precision_and_all_else_in_full(swept, collected):
    content = flax.serialization.msgpack_restore((swept / "results" / "policies" / "with_s1" / "policy.msgpack").read_bytes())
    for path, leaf in jax.tree_util.tree_leaves_with_path(content):
        if np.issubdtype(leaf.dtype, np.floating):
            assert leaf.dtype == (np.float16 if path[-1].key == "kernel" else np.float32), path


def test_a_damaged_policy_and_one_of_another_architecture_are_refused(swept, collected, tmp_path, capsys):
    folder = tmp_path / "policy"
    shutil.copytree(swept / "results" / "policies" / "with_s0", folder)
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"encoding": "none"}))
    with pytest.raises(CheckpointError, match=r"another architecture: .*policy/hidden_0/kernel is \(14, 8\)"):
        evaluate_hoppers(folder, 1, 4)
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "policy.msgpack").write_bytes((folder / "policy.msgpack").read_bytes()[:1000])
    with pytest.raises(CheckpointError, match=r"policy\.msgpack: damaged"):
        evaluate_hoppers(folder, 1, 4)


def test_collecting_nothing_is_an_error(tmp_path, capsys):
    with pytest.raises(SystemExit) as exit_info:
        collect.main([str(tmp_path), "--out", str(tmp_path / "results")])
    assert exit_info.value.code == 2
    assert "holds no run folders with results" in capsys.readouterr().err


def test_steps_to_reach_is_the_first_evaluation_at_or_above_the_value(tmp_path):
    writer = MetricsWriter(tmp_path)
    for steps, value in ((10, 1.0), (20, 5.0), (30, 3.0), (40, 6.0)):
        writer.write({"env_steps": steps, "r": value}, {"env_steps": steps})
    writer.close()
    assert read_curve(tmp_path, "r").tolist() == [[10, 1], [20, 5], [30, 3], [40, 6]]
    assert steps_to_reach(tmp_path, "r", 4.0) == 20
    assert steps_to_reach(tmp_path, "r", 7.0) is None


def write_timings(writer: MetricsWriter, *rows: tuple[int, float]) -> None:
    for steps, seconds in rows:
        writer.write({"env_steps": steps}, {"env_steps": steps, "seconds": seconds})
    writer.close()


def test_wall_time_of_old_files_adds_up_processes_that_each_count_from_zero(tmp_path):
    write_timings(MetricsWriter(tmp_path), (10, 5.0), (20, 9.0), (30, 2.0), (40, 4.5))
    assert read_wall_seconds(tmp_path) == 9.0 + 4.5
    resumed = MetricsWriter(tmp_path, resume_env_steps=40)
    write_timings(resumed, (50, resumed.seconds_before + 6.0))
    assert read_wall_seconds(tmp_path) == 9.0 + 4.5 + 6.0


def test_wall_time_counts_a_process_whose_first_evaluation_comes_later_than_all_before(tmp_path):
    write_timings(MetricsWriter(tmp_path), (10, 5.0), (20, 9.0))
    resumed = MetricsWriter(tmp_path, resume_env_steps=10)
    assert resumed.seconds_before == 5.0, "the row at 20 was lost"
    write_timings(resumed, (20, resumed.seconds_before + 700.0))
    assert read_wall_seconds(tmp_path) == 705.0


def test_runs_of_one_name_with_other_settings_have_rows_and_curves_of_their_own(tiny_config, tmp_path):
    for name, changes in {"a_s0": {}, "a_s1": {"seed": 1}, "wide_s0": {"num_envs": 8}}.items():
        run_folder.write_start(tmp_path / name, dataclasses.replace(tiny_config, **changes), "native")
        value = 40.0 if name == "wide_s0" else 10.0 + 2.0 * changes.get("seed", 0)
        writer = MetricsWriter(tmp_path / name)
        writer.write({"env_steps": 64, "train_return_mean": value}, {"env_steps": 64, "seconds": 1.0})
        writer.close()
    folders = sorted(tmp_path.iterdir())
    rows = summarise_runs(folders)
    assert [(row["runs"], row["train_return_mean"], row["train_return_std"]) for row in rows] == [
        (["a_s0", "a_s1"], 11.0, 1.4),
        (["wide_s0"], 40.0, None),
    ]
    assert list(group_folders(folders)) == [f"{tiny_config.name} (a_s0, a_s1)", f"{tiny_config.name} (wide_s0)"]


def test_tables_are_made_anew_from_the_results_alone(swept, collected, tmp_path, capsys):
    shutil.copytree(swept / "results", tmp_path / "results")
    summary = tmp_path / "results" / "hopper" / "summary.json"
    before = summary.read_bytes()
    summary.unlink()
    collect.main(["--out", str(tmp_path / "results")])
    assert summary.read_bytes() == before
    with pytest.raises(SystemExit) as exit_info:
        collect.main(["--out", str(tmp_path / "empty")])
    assert exit_info.value.code == 2
    assert "holds no published runs" in capsys.readouterr().err


def test_a_run_whose_policy_cannot_be_read_leaves_the_results_as_they_were(swept, tmp_path, capsys):
    shutil.copytree(swept / "runs", tmp_path / "runs")
    shutil.rmtree(tmp_path / "runs" / "without_s1" / "checkpoints")
    with pytest.raises(SystemExit) as exit_info:
        collect.main([str(tmp_path / "runs"), "--out", str(tmp_path / "results")])
    assert exit_info.value.code == 2
    assert "without_s1: holds no checkpoint" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


def test_fitting_says_how_many_steps_it_takes_of_each_robot(swept, capsys):
    evaluate_hoppers(swept / "runs" / "with_s1", 1, 4, fit_steps=1)
    assert "fitting v_h of 4 new robots, 16 control steps each" in capsys.readouterr().out  # an iteration of 64


def test_only_an_embedding_in_the_plane_is_drawn_as_one(tiny_config):
    config = dataclasses.replace(tiny_config, name="hopper_embedding", encoding="embedding")
    sizes = {size: dataclasses.replace(config, embedding=dataclasses.replace(config.embedding, size=size)) for size in (2, 8)}
    assert is_of_embedding(sizes[2])
    assert not is_of_embedding(sizes[8])
    assert not is_of_embedding(dataclasses.replace(sizes[2], encoding="none"))


def test_fine_tuning_reports_when_each_warm_start_reaches_what_scratch_ends_with(tiny_config, tmp_path):
    runs = {
        "scratch": ({}, [10.0, 50.0, 90.0]),
        "hidden": ({"init": "x"}, [20.0, 80.0, 95.0]),
        "all": ({"init": "x", "init_layers": "all"}, [91.0, 95.0, 99.0]),
    }
    for name, (changes, returns) in runs.items():
        run_folder.write_start(tmp_path / name, dataclasses.replace(tiny_config, **changes), "native")
        writer = MetricsWriter(tmp_path / name)
        for i, value in enumerate(returns):
            writer.write({"env_steps": 100 * (i + 1), "train_return_mean": value}, {"env_steps": 100 * (i + 1), "seconds": 1.0})
        writer.close()
    write_finetune([tmp_path / name for name in runs], tmp_path)
    rows = json.loads((tmp_path / "finetune.json").read_text())
    steps = {row["init_layers"]: row["pretrained_steps_to_scratch_final"] for row in rows}
    assert steps == {"hidden": 300, "all": 100}
    assert {row["scratch_final_return"] for row in rows} == {90.0}
    assert "no run from scratch" in write_finetune([tmp_path / "hidden"], tmp_path)

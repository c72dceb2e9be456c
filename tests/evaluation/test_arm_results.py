import json
import shutil

import pytest

from hcp_jax import collect, evaluate
from hcp_jax.evaluation.appendix import make_appendix
from hcp_jax.evaluation.arm_sweeps import evaluate_arms
from hcp_jax.evaluation.table1 import make_table1
from hcp_jax.training.metrics import read_rows

MEASURED = {"run": "arms_s0", "checkpoint_env_steps": 320, "trials": 1, "robots_per_trial": 1}
MEASURED |= {"physics": "native", "integrator": "rk4"}


@pytest.fixture(scope="module")
def results(finished_arms, tmp_path_factory):
    folder = tmp_path_factory.mktemp("collect")
    shutil.copytree(finished_arms, folder / "runs" / "arms_s0")
    collect.main([str(folder / "runs"), "--out", str(folder / "results")])
    return folder / "results"


def test_collected_successes_come_from_the_run_folder(results, finished_arms):
    last = read_rows(finished_arms / "metrics.csv")[-1]
    (row,) = json.loads((results / "arms" / "summary.json").read_text())
    assert (row["algorithm"], row["seeds"], row["env_steps"]) == ("HCP-E", [0], 320)
    assert row["left_out_success_mean"] == round(float(last["left_out_success"]), 1)
    assert (results / "arms" / "reacher_leave_h.png").read_bytes().startswith(b"\x89PNG")


def test_a_published_arm_policy_moves_as_its_run_does(results, finished_arms):
    records = [evaluate_arms(folder, 1, 2, types=("H",)) for folder in (finished_arms, results / "policies" / "arms_s0")]
    assert records[0]["robots"] == records[1]["robots"]
    measured, robots = records[0]["types"]["H"], records[0]["robots"]
    assert measured["final_distances"] == pytest.approx([robot["final_distance"] for robot in robots], abs=1e-4)
    assert measured["episode_lengths"] == [robot["episode_length"] for robot in robots]


def test_table_1_has_a_row_beside_the_papers_for_what_was_evaluated(results):
    evaluations = results / "arms" / "evaluations"
    evaluations.mkdir()
    arguments = ["--trials", "2", "--robots-per-trial", "3", "--without-robots"]
    evaluate.main([str(results / "policies" / "arms_s0"), *arguments, "--json", str(evaluations / "arms_s0.json")])
    (evaluations / "arms_s0_rk4.json").write_text("not read: no run of that name")
    (row,) = make_table1(results)
    measured = json.loads((evaluations / "arms_s0.json").read_text())["types"]["H"]
    assert (row["experiment"], row["algorithm"], row["train_types"], row["test_type"]) == (1, "HCP-E", "AI", "H")
    assert (row["paper_mean"], row["paper_std"]) == (92.5, 1.96)
    assert (row["success_mean"], row["control_steps"]) == (round(measured["success_mean"], 2), 320)
    assert (row["seeds"], row["policy"], row["success_std_over_seeds"]) == ([0], ["arms_s0"], None)
    by_type = {row["test_type"]: row for row in make_appendix(results)}
    assert set(by_type) == {"A", "I"}
    assert (by_type["A"]["experiment"], by_type["A"]["paper_mean"]) == (1, 93.1)
    measured = json.loads((evaluations / "arms_s0.json").read_text())["types"]["A"]
    assert by_type["A"]["success_mean"] == round(measured["success_mean"], 2)


def test_table_1_averages_evaluations_of_equal_settings_and_steps_alone(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    run, evaluations = folder / "arms" / "runs", folder / "arms" / "evaluations"
    config = json.loads((run / "arms_s0" / "config.json").read_text())
    record = json.loads((evaluations / "arms_s0.json").read_text())
    record["types"]["H"]["success_mean"] = 10.0
    (evaluations / "arms_s0.json").write_text(json.dumps(record))
    others = {
        "arms_s1": ({"seed": 1}, {}),
        "arms_s2": ({"seed": 2}, {"checkpoint_env_steps": 240}),
        "arms_s3": ({"seed": 3}, {"physics": "native-rk4", "integrator": "rk4"}),
        "wide_s0": ({"num_envs": 2 * config["num_envs"]}, {}),
    }
    for name, (change, measured) in others.items():
        shutil.copytree(run / "arms_s0", run / name)
        (run / name / "config.json").write_text(json.dumps(config | change))
        if "checkpoint_env_steps" in measured:  # its training was cut off there
            metrics = run / name / "metrics.csv"
            metrics.write_text("".join(metrics.read_text().splitlines(keepends=True)[:-1]))
        record["types"]["H"]["success_mean"] = 20.0
        record["run"] = name
        (evaluations / f"{name}.json").write_text(json.dumps(record | measured))
    rows = {tuple(row["policy"]): row for row in make_table1(folder)}
    assert {policies: row["control_steps"] for policies, row in rows.items()} == {
        ("arms_s0", "arms_s1"): 320,
        ("arms_s2",): 240,
        ("arms_s3",): 320,
        ("wide_s0",): 320,
    }
    both = rows["arms_s0", "arms_s1"]
    assert (both["success_mean"], both["success_std_over_seeds"]) == (15.0, 7.07), "the deviation is a sample's"


def test_an_evaluation_from_before_its_run_went_on_is_said_and_is_in_no_table(results, tmp_path, capsys):
    shutil.copytree(results, tmp_path / "results")
    path = tmp_path / "results" / "arms" / "evaluations" / "arms_s0.json"
    record = json.loads(path.read_text())
    assert make_table1(tmp_path / "results")
    path.write_text(json.dumps(record | {"checkpoint_env_steps": 240}))
    collect.main(["--out", str(tmp_path / "results")])
    assert f"{path}: after 240 steps, and its run ends at 320; not in the tables" in capsys.readouterr().out
    assert not json.loads((tmp_path / "results" / "table1.json").read_text())


def test_an_evaluation_of_another_policy_is_refused_before_anything_is_written(results, finished_arms, tmp_path, capsys):
    shutil.copytree(results, tmp_path / "results")
    shutil.copytree(finished_arms, tmp_path / "runs" / "arms_s1")
    path = tmp_path / "results" / "arms" / "evaluations" / "arms_s0.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"run": "runs/arms_s7"}))
    with pytest.raises(SystemExit):
        collect.main([str(tmp_path / "runs"), "--out", str(tmp_path / "results")])
    assert "run='runs/arms_s7': expected the policy arms_s0" in capsys.readouterr().err
    assert not (tmp_path / "results" / "policies" / "arms_s1").exists()


def test_a_type_that_one_seed_alone_was_evaluated_on_has_a_row_of_that_seed(results, tmp_path):
    shutil.copytree(results, tmp_path / "results")
    arms = tmp_path / "results" / "arms"
    shutil.copytree(arms / "runs" / "arms_s0", arms / "runs" / "arms_s1")
    config = json.loads((arms / "runs" / "arms_s0" / "config.json").read_text()) | {"seed": 1}
    (arms / "runs" / "arms_s1" / "config.json").write_text(json.dumps(config))
    record = json.loads((arms / "evaluations" / "arms_s0.json").read_text()) | {"run": "arms_s1"}
    del record["types"]["I"]
    (arms / "evaluations" / "arms_s1.json").write_text(json.dumps(record))
    assert {row["test_type"]: row["seeds"] for row in make_appendix(tmp_path / "results")} == {"A": [0, 1], "I": [0]}


def test_a_run_that_is_collected_later_is_added_to_those_before(results, finished_arms, tmp_path):
    shutil.copytree(finished_arms, tmp_path / "runs" / "arms_s1")
    config = json.loads((finished_arms / "config.json").read_text()) | {"seed": 1}
    (tmp_path / "runs" / "arms_s1" / "config.json").write_text(json.dumps(config))
    shutil.copytree(results, tmp_path / "results")
    collect.main([str(tmp_path / "runs"), "--out", str(tmp_path / "results")])
    (row,) = json.loads((tmp_path / "results" / "arms" / "summary.json").read_text())
    assert row["seeds"] == [0, 1]
    sizes = [(tmp_path / "results" / "policies" / f"arms_s{seed}" / "policy.msgpack").stat().st_size for seed in (0, 1)]
    assert sizes[1] < 0.7 * sizes[0], "a repetition is published without its critic"


def test_a_run_of_other_settings_does_not_replace_a_published_one(results, finished_arms, tmp_path, capsys):
    shutil.copytree(finished_arms, tmp_path / "runs" / "arms_s0")
    config = json.loads((finished_arms / "config.json").read_text()) | {"total_env_steps": 80}
    (tmp_path / "runs" / "arms_s0" / "config.json").write_text(json.dumps(config))
    before = {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}
    with pytest.raises(SystemExit) as exit_info:
        collect.main([str(tmp_path / "runs"), "--out", str(results)])
    assert exit_info.value.code == 2
    assert "its total_env_steps is 80, and 320 in" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in results.rglob("*") if path.is_file()} == before


def test_a_run_that_got_less_far_does_not_replace_a_published_one(results, finished_arms, tmp_path, capsys):
    folder = tmp_path / "runs" / "arms_s0"
    shutil.copytree(finished_arms, folder)
    (folder / "metrics.csv").write_text("".join((folder / "metrics.csv").read_text().splitlines(keepends=True)[:2]))
    before = {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}
    with pytest.raises(SystemExit) as exit_info:
        collect.main([str(folder.parent), "--out", str(results)])
    assert exit_info.value.code == 2
    assert "arms_s0, which it would replace, up to 320" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in results.rglob("*") if path.is_file()} == before


def test_an_evaluation_of_a_policy_that_was_replaced_is_named(results, finished_arms, tmp_path, capsys):
    shutil.copytree(results, tmp_path / "results")
    shutil.copytree(finished_arms, tmp_path / "runs" / "arms_s0")
    record = tmp_path / "results" / "arms" / "evaluations" / "arms_s0.json"
    record.parent.mkdir(exist_ok=True)
    record.write_text(json.dumps(MEASURED | {"types": {}}))
    collect.main([str(tmp_path / "runs"), "--out", str(tmp_path / "results")])
    assert "measure it anew" not in capsys.readouterr().out
    policy = tmp_path / "results" / "policies" / "arms_s0" / "policy.msgpack"
    policy.write_bytes(policy.read_bytes()[:-1] + b"\x01")
    collect.main([str(tmp_path / "runs"), "--out", str(tmp_path / "results")])
    assert f"{record}: of the policy that" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("arms/evaluations/arms_s0.json", {"types": {}}, "no field 'run'"),
        (
            "arms/evaluations/arms_s0.json",
            MEASURED | {"types": {"H": {}}},
            "no field 'success_mean'",
        ),
        (
            "arms/evaluations/arms_s0.json",
            MEASURED | {"types": {}, "ranges": {"damping": [1.0, 2.0]}},
            "ranges={'damping': [1.0, 2.0]}: expected the newest checkpoint",
        ),
        ("arms/runs/arms_s0/metrics.csv", "a\n1\n", "env_steps=None: expected a whole number"),
        ("arms/runs/arms_s0/environment.json", {}, "no field 'commit'"),
    ],
)
def test_collecting_names_the_damaged_file(results, tmp_path, capsys, name, content, expected):
    shutil.copytree(results, tmp_path / "results")
    path = tmp_path / "results" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(SystemExit) as exit_info:
        collect.main(["--out", str(tmp_path / "results")])
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert f"{path}: damaged or of another version ({expected}" in error

"""The report says what the files of the results say, names what is missing, and refuses what is damaged."""

import dataclasses
import html.parser
import json
import pathlib
import re
import runpy
import shutil

import mujoco
import numpy as np
import pytest

from hcp_jax import report
from hcp_jax.config import Config
from hcp_jax.evaluation.appendix import PAPER_DAMPING, PAPER_TRAINING_TYPES, PAPER_TYPES
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.records import read_evaluation, read_table
from hcp_jax.evaluation.table1 import PAPER
from hcp_jax.hardware.arm import arm_spec
from hcp_jax.hardware.start_poses import start_angles
from hcp_jax.reporting.curves import train_commands
from hcp_jax.reporting.pool_sizes import LIST, NAMES
from hcp_jax.reporting.published import Published
from hcp_jax.reporting.robots import arm_pose
from hcp_jax.reporting.settings import LISTED, LISTED_COMMAND, SETTINGS, name_inputs, roman
from hcp_jax.reporting.tables import letters
from hcp_jax.training import run_folder
from hcp_jax.training.metrics import MetricsWriter

ROOT = pathlib.Path(__file__).resolve().parents[2]
QUANTILES = {"0": 0.001, "0.25": 0.01, "0.5": 0.015, "0.75": 0.2, "0.95": 0.5, "1": 0.9}


class Page(html.parser.HTMLParser):
    """The tables of a page by section and caption, its ids, pictures, and everything that it refers to."""

    def __init__(self, text: str):
        super().__init__()
        self.tables: dict[tuple[str, str], list[list[str]]] = {}
        self.tags: set[str] = set()
        self.references: list[str] = []
        self.pictures: dict[str, list[str]] = {}
        self._section = self._caption = ""
        self._cell: list[str] | None = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.tags.add(tag)
        self.references += [values[name] for name in ("src", "href") if name in values]
        if tag == "section":
            self._section = values["id"]
            self.pictures[self._section] = []
        if tag == "img":
            self.pictures[self._section].append(values["alt"])
        if tag in ("caption", "td", "th"):
            self._cell = []
        if tag == "tr":
            self.tables[self._section, self._caption].append([])

    def handle_data(self, data):
        if self._cell is not None:
            self._cell.append(data)

    def handle_endtag(self, tag):
        if tag in ("caption", "td", "th"):
            text, self._cell = "".join(self._cell or ()).strip(), None
            if tag == "caption":
                number = sum(section == self._section and name.startswith(text) for section, name in self.tables)
                self._caption = f"{text} {number}" if number else text
                self.tables[self._section, self._caption] = []
            else:
                self.tables[self._section, self._caption][-1].append(text)

    def rows(self, section: str, caption: str) -> list[dict[str, str]]:
        """The rows of a table, by column."""
        columns, *rows = self.tables[section, caption]
        return [dict(zip(columns, row, strict=True)) for row in rows]


def build(results: pathlib.Path, out: pathlib.Path) -> str:
    report.main([str(results), "--out", str(out)])
    return out.read_text()


@pytest.fixture(scope="module")
def committed(tmp_path_factory) -> Page:
    return Page(build(ROOT / "results", tmp_path_factory.mktemp("committed") / "report.html"))


def table1(page: Page) -> list[dict[str, str]]:
    tasks = ("Reacher", "Peg insertion, fixed hole", "Peg insertion, random hole")
    return [row for task in tasks for row in page.rows("table1", task)]


def spread(mean: float, deviation: float) -> str:
    return f"{mean:.2f} ± {deviation:.2f}"


def test_the_committed_results_make_a_page_that_loads_nothing(committed):
    assert {"script", "link", "iframe", "object"} & committed.tags == set()
    assert committed.references
    for reference in committed.references:
        assert reference.startswith(("data:image/svg+xml;base64,", "#")), reference[:80]
    assert len(committed.pictures["robots"]) == 12  # A to K and the hopper


def test_table_1_shows_every_row_of_its_file_beside_the_papers(committed):
    rows, controls = table1(committed), committed.rows("table1", "Controls")
    for row in json.loads((ROOT / "results" / "table1.json").read_text()):
        name = ", ".join(row["policy"])
        (shown,) = [r for r in rows + controls if name in (r.get("policies, or training"), r.get("policies"))]
        assert shown["ours [%]"] == spread(row["success_mean"], row["success_std_over_trials"])
        assert shown.get("Exp.", "") == roman(row["experiment"])
        if row["paper_mean"] is None:
            assert (shown["paper [%]"], shown["difference"]) == ("", "")
        else:
            assert shown["paper [%]"] == spread(row["paper_mean"], row["paper_std"])
            points = float(shown["difference"].replace("\N{MINUS SIGN}", "-"))
            assert points == pytest.approx(row["success_mean"] - row["paper_mean"], abs=0.006)


def test_every_experiment_that_the_page_names_is_a_file(tmp_path):
    text = build(ROOT / "results", tmp_path / "report.html")
    names = set(re.findall(r"experiments/\w+\.py", text))
    assert len(names) > 20
    assert not [name for name in names if not (ROOT / name).is_file()]


def test_what_a_list_runs_has_no_file_of_its_own():
    configs = runpy.run_path(str(ROOT / "experiments" / "encodings.py"))["get_configs"]()
    without = {config.name for config in configs if not (ROOT / "experiments" / f"{config.name}.py").exists()}
    assert set(LISTED) == without
    assert train_commands(["reacher_chain_leave_h", "peg_goal_offset_leave_h"]) == (LISTED_COMMAND,)


def test_every_experiment_of_table_1_is_there_with_the_papers_figure(committed):
    rows = table1(committed)
    measured = {row["experiment"] for row in json.loads((ROOT / "results" / "table1.json").read_text())}
    for experiment, hcpe, ddpg in PAPER.values():
        for number, paper in ((experiment, hcpe), (experiment + 1, ddpg)):
            shown = [row for row in rows if row["Exp."] == roman(number)]
            assert shown
            assert {row["paper [%]"] for row in shown} == {spread(*paper)}
            if number not in measured:
                assert shown[0]["ours [%]"] in ("not run", "not evaluated")
                assert shown[0]["policies, or training"].startswith("python -m hcp_jax.train --config experiments/")


def test_the_appendix_tables_show_ours_and_the_papers_figures(committed):
    rows = [
        row for (section, _), (columns, *rest) in committed.tables.items() if section == "types" for row in (columns, *rest)
    ]
    assert rows
    by_experiment: dict[tuple[str, str, str], list[str]] = {
        (row[0], row[2], row[3]): row[4:13] for row in rows if len(row) == 13
    }
    for experiment, figures in PAPER_TRAINING_TYPES.items():
        assert [cell for cell in by_experiment[roman(experiment), "", "paper"] if "±" in cell] == [spread(*f) for f in figures]
    ours = [row for row in json.loads((ROOT / "results" / "appendix.json").read_text()) if row["test_type"] in PAPER_TYPES]
    for row in ours:
        if row["experiment"]:
            inputs = name_inputs(row["encoding"], row["joint_slots"], row["network"])
            cells = by_experiment[roman(row["experiment"]), inputs, "ours"]
            shown = cells[PAPER_TYPES.index(row["test_type"])]
            assert shown == spread(row["success_mean"], row["success_std_over_trials"])


def test_settings_name_the_sixteen_experiments_that_the_sweep_runs():
    names = [name for setting in SETTINGS for name in setting.experiment_names]
    assert names == list(runpy.run_path(str(ROOT / "experiments" / "table1.py"))["NAMES"])
    assert [setting.experiment for setting in SETTINGS] == list(range(1, 17, 2))


@pytest.mark.parametrize("robot_type", ["A", "H", "K"])
def test_a_sketched_arm_stands_as_mujoco_has_it(robot_type):
    positions, axes = arm_pose(robot_type)
    model = arm_spec("peg_insertion", robot_type).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = next(pose for pose in start_angles("reacher", robot_type)[37:])[: model.nq]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(positions[-1], data.site("ref_pt").xpos, atol=1e-5)
    np.testing.assert_allclose(positions[:-1], data.xanchor, atol=1e-5)
    np.testing.assert_allclose(np.abs((axes * data.xaxis).sum(axis=1)), 1.0, atol=1e-5)


def write_run(folder: pathlib.Path, config: Config, rows: list[dict]) -> None:
    run_folder.write_start(folder, config, "native")
    writer = MetricsWriter(folder)
    for row in rows:
        writer.write(row, {"env_steps": row["env_steps"], "seconds": 60.0})
    writer.close()


def evaluation(policy: str, types: dict, **changes) -> dict:
    record = {"run": f"results/policies/{policy}", "task": "peg_insertion", "encoding": "none", "trials": 1}
    record["checkpoint_env_steps"] = 3_000_000
    return record | {"robots_per_trial": 100, "ranges": {}, "types": types} | changes


def outcome(success: float, **changes) -> dict:
    values = {"zero_shot": True, "success_mean": success, "success_std": 1.0, "reachable_success_mean": success}
    return values | {"episode_length_mean": 50.0, "final_distance_quantiles": QUANTILES} | changes


@pytest.fixture(scope="module")
def results(tiny_arms, tiny_config, tmp_path_factory) -> pathlib.Path:
    """A folder of results with little in it, but something of each kind."""
    folder = tmp_path_factory.mktemp("tiny") / "results"
    reacher = dataclasses.replace(tiny_arms, name="reacher_film_leave_h")
    for seed in (0, 1):
        rows = [{"env_steps": n, "train_types_success": 10.0 * n + seed, "left_out_success": 5.0 * n} for n in (80, 160)]
        write_run(folder / "arms" / "runs" / f"{reacher.name}_s{seed}", dataclasses.replace(reacher, seed=seed), rows)
    baseline = dataclasses.replace(tiny_arms, name="reacher_ddpg_leave_h", encoding="none")
    write_run(folder / "arms" / "runs" / f"{baseline.name}_s0", baseline, [{"env_steps": 80, "train_types_success": 0.0}])
    for name, init, successes in (("", "x", (30.0, 80.0, 90.0)), ("_scratch", "", (0.0, 10.0, 60.0))):
        tuned = dataclasses.replace(tiny_arms, name=f"random_peg_finetune_h{name}", init=init)
        rows = [{"env_steps": (i + 1) * 1_000_000, "train_types_success": value} for i, value in enumerate(successes)]
        write_run(folder / "arms" / "runs" / f"{tuned.name}_s0", tuned, rows)
    single = {"final_distances": [0.01, 0.02, 0.4], "episode_lengths": [20, 30, 200]}
    records = folder / "arms" / "evaluations"
    write_json(records / "reacher_film_leave_h_s0.json", evaluation("reacher_film_leave_h_s0", {"H": outcome(90.0, **single)}))
    write_json(records / "reacher_ddpg_leave_h_s0.json", evaluation("reacher_ddpg_leave_h_s0", {"H": outcome(0.0)}))
    for low, high, success in ((0.01, 2.0, 99.0), (40.0, 50.0, 51.0)):
        record = evaluation("low_s0", {"I": outcome(success, **single)}, ranges={"damping": [low, high]})
        write_json(folder / "arms" / "damping" / f"low_s0_{low:g}_{high:g}.json", record)
    film = evaluation("film_s0", {"I": outcome(98.0, **single)}, encoding="chain_fk", ranges={"damping": [20.0, 30.0]})
    write_json(folder / "arms" / "damping" / "film_s0_20_30.json", film)
    for number, of_types, left_out in ((40, (80.0, 90.0), 70.0), (10, (30.0, 50.0), 20.0)):
        pool = dataclasses.replace(tiny_arms.pool, robots_per_type=number)
        config = dataclasses.replace(tiny_arms, name=f"reacher_pool_{number}", pool=pool)
        write_run(folder / "arms" / "runs" / f"{config.name}_s0", config, [{"env_steps": 80, "train_types_success": 1.0}])
        types = {name: outcome(mean, zero_shot=False) for name, mean in zip("AB", of_types, strict=True)}
        record = evaluation(f"{config.name}_s0", types | {"H": outcome(left_out)})
        write_json(folder / "arms" / "pool_sizes" / f"{config.name}_s0.json", record)
    for encoding in ("none", "kinematics"):
        hopper = dataclasses.replace(tiny_config, name=f"hopper_{encoding}", encoding=encoding)
        rows = [{"env_steps": n, "train_return_mean": 2.0 * n, "heldout_return_mean": 1.0 * n} for n in (64, 128)]
        write_run(folder / "hopper" / "runs" / f"{hopper.name}_s0", hopper, rows)
    write_json(
        folder / "hopper" / "embedding.json",
        {"neighbours": 5, "r2": 0.5, "embedding": [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]], "torso_mass": [1.0, 2.0, 3.0]},
    )
    for seed in (0, 1):
        sets = {"train": 100.0, "heldout": 10.0, "heldout_first_50": 40.0 + 20.0 * seed}
        record = {"run": f"runs/hopper_hcpi_s{seed}", "sets": {name: {"return_mean": mean} for name, mean in sets.items()}}
        write_json(folder / "hopper" / "evaluations" / f"hopper_hcpi_s{seed}_first_steps.json", record)
    for name, distances in (("reacher_hcpe_leave_h", (0.01, 0.3)), ("reacher_sawyer", (0.01, 0.02))):
        trials = [{"final_distance": distance} for distance in distances]
        record = {"run": f"results/policies/{name}_s0", "robot": "sawyer", "encoding": "chain_fk"}
        conditions = {"ideal": {"success": 100.0, "trials": trials}, "real": {"success": 50.0, "trials": trials}}
        write_json(folder / "rehearsal" / f"{name}_s0_sawyer.json", record | {"conditions": conditions})
    return folder


@pytest.fixture(scope="module")
def tiny(results, tmp_path_factory) -> Page:
    return Page(build(results, tmp_path_factory.mktemp("page") / "report.html"))


def test_the_stress_test_stands_beside_the_papers(tiny):
    rows = tiny.rows("damping", "Success by range of damping")
    shown = {row["damping [N m s/rad]"]: (row["ours [%]"], row["paper [%]"], row["difference"]) for row in rows}
    assert shown["0.01 to 2"] == ("99.00", "100.00", "\N{MINUS SIGN}1.00")
    assert shown["40 to 50"] == ("51.00", "47.00", "+4.00")
    assert shown["2 to 10"] == ("not run", "100.00", "")
    assert len(rows) == len(PAPER_DAMPING) + 1
    assert any("Violins" in alt for alt in tiny.pictures["damping"])


def test_the_stress_test_of_hcpe_is_not_set_beside_the_papers_ddpg(tiny):
    rows = [row for row in tiny.rows("damping", "Success by range of damping") if row["damping [N m s/rad]"] == "20 to 30"]
    shown = [(row["algorithm"], row["ours [%]"], row["paper [%]"], row["difference"]) for row in rows]
    assert shown == [("DDPG+HER", "not run", "100.00", ""), ("HCP-E", "98.00", "", "")]


def test_the_rehearsed_sawyer_stands_beside_the_papers_real_one(tiny):
    a, c = tiny.rows("rehearsal", "Success [%] under each condition alone, and under all (real)")
    assert (a["policy"], c["policy"]) == ("A reacher_hcpe_leave_h_s0", "C reacher_sawyer_s0")
    assert (a["ideal"], a["real"], a["difference"]) == ("100.00", "50.00", "\N{MINUS SIGN}25.00")
    assert (a["median distance, real [m]"], c["median distance, real [m]"]) == ("0.155", "0.015")
    assert (c["real"], c["paper, real arm"], c["difference"]) == ("50.00", "", "")
    assert "Violins" in tiny.pictures["rehearsal"][0]


def test_success_stands_beside_the_number_of_training_robots_that_it_was_reached_with(tiny):
    few, more = tiny.rows("pool_sizes", "Success on new arms")
    assert list(few.values()) == ["10", "40.00", "20.00 \N{PLUS-MINUS SIGN} 1.00", "0", "3.00", "reacher_pool_10_s0"]
    assert (more["arms of each type"], more["types trained on [%]"], more["type left out [%]"][:5]) == ("40", "85.00", "70.00")
    assert [alt.split(".")[0] for alt in tiny.pictures["pool_sizes"]] == [
        "New arms: New arms, 100 of each type",
        "Their training: New arms of the types trained on",
    ]


def test_the_pool_sizes_of_the_page_are_those_of_the_sweep():
    configs = runpy.run_path(str(ROOT / LIST))["get_configs"]()
    assert tuple(config.name for config in configs) == NAMES


def test_what_first_steps_tell_is_averaged_over_seeds(tiny):
    rows = tiny.rows("hopper", "Return of one episode: mean and sample standard deviation over seeds")
    shown = {row["v_h from"]: (row["return"], row["seeds"]) for row in rows}
    assert shown["50 control steps of its own"] == ("50.0 \N{PLUS-MINUS SIGN} 14.1", "2")
    assert shown["nothing: the mean"] == ("10.0 \N{PLUS-MINUS SIGN} 0.0", "2")


def test_distances_are_violins_where_single_episodes_are_kept_and_boxes_where_quantiles_are(tiny):
    (alt,) = tiny.pictures["distances"]
    assert "Violins" in alt
    assert "Boxes" in alt


def test_what_is_not_run_is_said_with_the_paper_beside_it(tiny):
    rows = table1(tiny)
    assert len(rows) == 16
    assert rows[2]["ours [%]"] == "not run"
    assert (rows[0]["ours [%]"], rows[0]["control steps [M]"]) == ("not evaluated", "0.00 of 0.00")
    assert {row["control steps [M]"] for row in rows[2:]} == {""}
    assert tiny.pictures["seven"] == []


def test_missing_files_are_named_and_the_page_is_the_same_each_time(results, tiny, tmp_path, capsys):
    pages = {build(results, tmp_path / "page.html") for _ in range(2)}
    assert len(pages) == 1
    said = capsys.readouterr().out
    for name in ("table1.json", "appendix.json", "hopper/summary.json", "hopper/finetune.json"):
        assert said.count(f"{results}/{name}: missing") == 2  # once each time
    assert "not run" in pages.pop()


def fails(capsys, results: pathlib.Path, out: pathlib.Path) -> str:
    with pytest.raises(SystemExit) as exit_info:
        report.main([str(results), "--out", str(out)])
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


ROW = {"experiment": 1, "task": "reacher", "success_mean": 90.0}
FULL_ROW = json.loads((ROOT / "results" / "table1.json").read_text())[0]
DAMAGED = {
    "cut off": ("table1.json", '[\n {"experiment": 1,', "damaged"),
    "no list": ("table1.json", "{}", "holds a dict, expected a list"),
    "a row without its fields": ("appendix.json", json.dumps([ROW]), "no field"),
    "no number": (
        "arms/damping/low_s0_0.01_2.json",
        json.dumps(evaluation("a", {"I": outcome("high")})),
        "'high' is no finite",
    ),
    "infinite": ("arms/damping/low_s0_0.01_2.json", json.dumps(evaluation("a", {"I": outcome(np.inf)})), "inf is no finite"),
    "no range": ("arms/damping/low_s0_0.01_2.json", json.dumps(evaluation("a", {"I": outcome(1.0)})), "no field 'damping'"),
    "an evaluation cut off": ("arms/evaluations/reacher_ddpg_leave_h_s0.json", '{"run": "a"', "damaged"),
    "other quantiles": (
        "arms/evaluations/reacher_ddpg_leave_h_s0.json",
        json.dumps(evaluation("a", {"H": outcome(0.0, final_distance_quantiles={"0.5": 0.1})})),
        "no field '0'",
    ),
    "bytes": ("arms/evaluations/reacher_film_leave_h_s0.json", b"\xff\xfe\x00", "damaged"),
    "a config cut off": ("arms/runs/reacher_film_leave_h_s0/config.json", "{", "damaged"),
    "a config of bytes": ("hopper/runs/hopper_none_s0/config.json", b"\xff\xfe\x00", "damaged"),
    "a config that is a list": ("hopper/runs/hopper_none_s0/config.json", "[]", "damaged"),
    "infinite steps": ("appendix.json", json.dumps([FULL_ROW | {"control_steps": np.inf}]), "infinity"),
    "metrics with a word": (
        "arms/runs/reacher_film_leave_h_s1/metrics.csv",
        "env_steps,train_types_success\n80,high\n",
        "high",
    ),
    "metrics of something else": (
        "hopper/runs/hopper_none_s0/metrics.csv",
        "a,train_return_mean\n1,2\n",
        "env_steps=None: expected a whole number",
    ),
    "a rehearsal without goals": (
        "rehearsal/reacher_sawyer_s0_sawyer.json",
        json.dumps({"run": "a", "robot": "b", "encoding": "none", "conditions": {"real": {"success": 1.0, "trials": []}}}),
        "no trials",
    ),
    "a rehearsal of other conditions": (
        "rehearsal/reacher_sawyer_s0_sawyer.json",
        json.dumps({"run": "a", "robot": "b", "encoding": "none", "conditions": {}}),
        "no field 'real'",
    ),
    "pool sizes without a run": (
        "arms/pool_sizes/reacher_pool_10_s0.json",
        json.dumps(evaluation("gone_s0", {"H": outcome(1.0)})),
        "no run of its policy gone_s0",
    ),
    "pool sizes without a type left out": (
        "arms/pool_sizes/reacher_pool_10_s0.json",
        json.dumps(evaluation("reacher_pool_10_s0", {"A": outcome(1.0, zero_shot=False)})),
        "expected types that were trained on, and one that was left out",
    ),
    "pool sizes without types trained on": (
        "arms/pool_sizes/reacher_pool_10_s0.json",
        json.dumps(evaluation("reacher_pool_10_s0", {"H": outcome(1.0)})),
        "expected types that were trained on, and one that was left out",
    ),
    "summary": ("hopper/summary.json", '[{"algorithm": "PPO"}]', "no field"),
    "finetune": ("hopper/finetune.json", '[{"run": "a"}]', "no field"),
    "first steps": (
        "hopper/evaluations/hopper_hcpi_s0_first_steps.json",
        '{"run": "a_s0", "sets": {"else": {"return_mean": 1}}}',
        "else",
    ),
    "embedding": (
        "hopper/embedding.json",
        '{"embedding": [[1, 2]], "torso_mass": [1, 2]}',
        "1 rows of embedding, 2 of torso_mass",
    ),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_ends_the_command_with_its_name(name, results, tmp_path, capsys):
    path, content, expected = DAMAGED[name]
    copy = tmp_path / "results"
    shutil.copytree(results, copy)
    (copy / path).write_bytes(content if isinstance(content, bytes) else content.encode())
    error = fails(capsys, copy, tmp_path / "report.html")
    assert str(copy / path) in error
    assert expected in error
    assert not (tmp_path / "report.html").exists()


def test_a_folder_without_results_is_refused(tmp_path, capsys):
    assert "nowhere: no folder of results" in fails(capsys, tmp_path / "nowhere", tmp_path / "report.html")


def test_a_file_that_is_no_report_is_kept(results, tmp_path, capsys):
    (tmp_path / "thesis.html").write_text("<!DOCTYPE html><p>mine")
    assert "thesis.html: exists and is no report" in fails(capsys, results, tmp_path / "thesis.html")
    assert (tmp_path / "thesis.html").read_text() == "<!DOCTYPE html><p>mine"
    assert "Is a directory" in fails(capsys, results, tmp_path)


def test_fine_tuning_is_compared_by_steps(tiny):
    (row,) = tiny.tables["finetuning", "Steps to what a training from scratch ends with"][1:]
    assert row == ["60.0", "3.00", "2.00", "67", "90.0"]
    assert len(tiny.pictures["finetuning"]) == 1


def test_only_seeds_of_one_config_are_averaged(tiny_config, tmp_path):
    changes = (
        {"seed": 0},
        {"seed": 1},
        {"init": "runs/a"},
        {"init": "runs/b", "seed": 1},
        {"init": "runs/a", "init_layers": "all"},
    )
    for number, change in enumerate(changes):
        config = dataclasses.replace(tiny_config, name="same", **change)
        write_run(tmp_path / "hopper" / "runs" / f"run{number}", config, [{"env_steps": 64, "train_return_mean": 1.0}])
    groups = Published(tmp_path).runs_of(["same"])
    assert [[run.folder.name for run in group] for group in groups] == [["run0", "run1"], ["run2", "run3"], ["run4"]]


def test_letters_are_shown_as_ranges():
    assert letters("ABCDEFGI") == "A-G, I"
    assert letters("ABCDFGHI") == "A-D, F-I"
    assert letters("AB") == "AB"


def test_a_record_with_lists_of_numbers_reads_back_as_it_was(tmp_path):
    record = {"a": [1, -2.5, 1e-07], "b": [[0.5], []], "c": "[\n 1,\n 2]", "d": ["x", 1], "e": {"f": [None, 3]}}
    write_json(tmp_path / "record.json", record)
    text = (tmp_path / "record.json").read_text()
    assert json.loads(text) == record
    assert "[1, -2.5, 1e-07]" in text


def test_committed_records_are_read_whole():
    assert len(read_table(ROOT / "results" / "table1.json")) == len(json.loads((ROOT / "results" / "table1.json").read_text()))
    for path in (ROOT / "results" / "arms" / "evaluations").glob("*.json"):
        types = json.loads(path.read_text())["types"]
        assert {name: o.success_mean for name, o in read_evaluation(path).types.items()} == {
            name: values["success_mean"] for name, values in types.items()
        }
    assert not re.search(r"NaN|Infinity", (ROOT / "results" / "table1.json").read_text())


def test_v_h_is_named_with_what_is_unusual_beside_it():
    assert name_inputs("chain_fk", "packed", "flat") == "chain_fk"
    assert name_inputs("chain_fk+jacobian", "aligned", "joints") == "chain_fk+jacobian, aligned joints, network joints"

"""The tables of README and docs say what the files under results/ say."""

import json
import pathlib
import re

import numpy as np
import pytest

from hcp_jax.reporting.settings import ROMAN
from hcp_jax.training.metrics import read_rows

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS = ROOT / "results"
PLAIN = re.compile(r"[`*]")


def read_tables(page: str) -> list[list[dict[str, str]]]:
    """Every table of a page, as rows by the columns' titles; a column without a title is numbered."""
    tables, lines = [], []
    for line in [*(ROOT / page).read_text().splitlines(), ""]:
        if line.strip().startswith("|"):
            lines.append([cell.strip() for cell in line.strip().strip("|").split("|")])
        elif lines:
            titles = [title or str(i) for i, title in enumerate(lines[0])]
            tables.append([dict(zip(titles, row, strict=True)) for row in lines[2:]])
            lines = []
    return tables


def find_tables(page: str, *titles: str) -> list[list[dict[str, str]]]:
    found = [table for table in read_tables(page) if table and set(titles) <= table[0].keys()]
    assert found, f"{page}: no table with {titles}"
    return found


def read_json(name: str) -> list | dict:
    return json.loads((RESULTS / name).read_text())


def find_run(name: str) -> pathlib.Path:
    """The folder of a run that a table names, of seed 0 where it names none."""
    names = (name, f"{name}_s0")
    return next(path for kind in ("arms", "ablations") for n in names if (path := RESULTS / kind / "runs" / n).is_dir())


def read_evaluations(name: str) -> list[dict]:
    """Of each seed of an arm run that a table names, success by type."""
    paths = [path for kind in ("arms", "ablations") for path in sorted((RESULTS / kind / "evaluations").glob(f"{name}*.json"))]
    paths = [path for path in paths if re.fullmatch(rf"{name}(_s\d)?", path.stem)]
    return [json.loads(path.read_text())["types"] for path in paths]


@pytest.mark.parametrize("row", find_tables("README.md", "Exp.", "HCP-E", "DDPG+HER")[0], ids=lambda row: row["Exp."])
def test_a_row_of_table_1_is_two_rows_of_its_file(row):
    table = read_json("table1.json")
    minutes = []
    for number, column in zip(row["Exp."].split(", "), ("HCP-E", "DDPG+HER"), strict=True):
        runs = [
            run for run in table if run["experiment"] == ROMAN.index(number) + 1 and run["test_type"] == row["type left out"]
        ]
        said = row[column].split(" (")[0]
        same = [run for run in runs if f"{run['success_mean']:.1f} ± {run['success_std_over_trials']:.1f}" == said]
        assert same, f"{number}: {said} is none of {[(run['success_mean'], run['success_std_over_trials']) for run in runs]}"
        seeds = re.search(r"(\d) seeds", row[column])
        assert len(same[0]["seeds"]) == int(seeds[1] if seeds else 1)
        assert (column == "HCP-E") == (same[0]["network"] == "film")
        minutes.append(f"{same[0]['wall_seconds'] / 60:.0f}")
    assert row["minutes of each"] == ", ".join(minutes)


BY_TYPE = find_tables("docs/results.md", "run", "masked", "H, zero-shot")[0]
OURS = [row for row in BY_TYPE if not row["run"].startswith("the paper's")]


@pytest.mark.parametrize("row", OURS, ids=lambda row: row["run"])
def test_success_by_type_is_that_of_the_evaluations(row):
    seeds = read_evaluations(re.search(r"`(\w+)`", row["run"])[1])
    number = re.search(r"(\d) seeds", row["run"])
    assert len(seeds) == int(number[1] if number else 1)
    for title, said in row.items():
        if title.split(",")[0] in "ABCDEFGHI":
            outcomes = [types[title.split(",")[0]] for types in seeds]
            mean, std = (np.mean([outcome[name] for outcome in outcomes]) for name in ("success_mean", "success_std"))
            numbers = [float(number) for number in said.split(" ± ")]
            assert numbers == pytest.approx([mean, std][: len(numbers)], abs=0.0501), title


WITHOUT_AND_WITH_FILM = {
    "I": ("reacher_aligned_leave_h", "reacher_film_leave_h"),
    "III": ("reacher_aligned_leave_e", "reacher_film_leave_e"),
    "V": ("peg_aligned_leave_h", "peg_film_leave_h"),
    "VII": ("peg_aligned_leave_e_masked", "peg_film_leave_e"),
    "IX": ("peg_aligned_leave_i", "peg_film_leave_i"),
    "XI": ("random_peg_jacobian_leave_h", "random_peg_film_leave_h"),
    "XIII": ("random_peg_aligned_leave_e", "random_peg_film_leave_e"),
    "XV": ("random_peg_aligned_leave_i", "random_peg_film_leave_i"),
}


@pytest.mark.parametrize("row", find_tables("docs/results.md", "Exp.", "without", "with")[0], ids=lambda row: row["Exp."])
def test_what_film_brings_is_that_of_the_evaluations_of_each_seed(row):
    for said, name in zip((row["without"], row["with"]), WITHOUT_AND_WITH_FILM[row["Exp."]], strict=True):
        seeds = read_evaluations(name)
        left_out, trained = (re.findall(r"\d+\.\d", part) for part in (said.split("(")[0], said.partition("(")[2]))
        assert [float(number) for number in left_out] == pytest.approx(
            [s[row["type"]]["success_mean"] for s in seeds], abs=0.0501
        )
        if trained:
            means = [np.mean([each["success_mean"] for each in types.values() if not each["zero_shot"]]) for types in seeds]
            assert [float(number) for number in trained] == pytest.approx(means, abs=0.0501)


@pytest.mark.parametrize("row", find_tables("docs/results.md", "arms of each type")[0], ids=lambda row: row["policy"])
def test_success_by_training_robots_is_that_of_the_evaluation(row):
    name = row["policy"].strip("`")
    types = read_json(f"arms/pool_sizes/{name}.json")["types"]
    config = json.loads((find_run(name) / "config.json").read_text())
    assert config["pool"]["robots_per_type"] == int(row["arms of each type"].replace(",", ""))
    trained = np.mean([outcome["success_mean"] for outcome in types.values() if not outcome["zero_shot"]])
    numbers = [float(number) for number in (row["types trained on"], *row["H, zero-shot"].split(" ± "))]
    assert numbers == pytest.approx([trained, types["H"]["success_mean"], types["H"]["success_std"]], abs=0.0501)


@pytest.mark.parametrize("row", find_tables("README.md", "experiment", "held out")[0], ids=lambda row: row["experiment"])
def test_hopper_returns_are_those_of_the_summary(row):
    (run,) = [run for run in read_json("hopper/summary.json") if run["name"] == row["experiment"].strip("`")]
    for title, name in (("robots trained on", "train"), ("held out", "heldout"), ("held out, v_h fitted", "heldout_fitted")):
        mean, std = run[f"{name}_return_mean"], run[f"{name}_return_std"]
        said = [int(number) for number in row[title].split(" ± ") if number]
        assert said == ([] if mean is None else pytest.approx([mean, std], abs=0.501))
    assert row["minutes"] == f"{run['wall_seconds'] / 60:.0f}"


def test_success_on_the_catalogue_is_that_of_its_file():
    chains, fine_tuned, exp_i = find_tables("README.md", "Fetch", "median")[0]
    for robot in read_json("catalogue.json"):
        (title,) = [title for title in chains if title.lower() == robot["robot"]]
        (of_chains, of_exp_i), tuned = robot["zero_shot"], robot["fine_tuned"]
        said = [float(row[title]) for row in (chains, exp_i, fine_tuned)]
        assert said == [of_chains["success_mean"], of_exp_i["success_mean"], tuned["success_mean"]], title
    for row in (chains, fine_tuned, exp_i):
        numbers = [float(said) for title, said in row.items() if title not in ("0", "median")]
        assert abs(float(row["median"]) - np.median(numbers)) < 0.0501


CURVES = [row for table in find_tables("docs/ablations.md", "0.5 M", "1.5 M") for row in table]
NAMED = [row for row in CURVES if "`" in list(row.values())[-1]]


@pytest.mark.parametrize("row", NAMED, ids=lambda row: PLAIN.sub("", list(row.values())[-1]))
def test_learning_curves_are_those_of_the_runs(row):
    rows = read_rows(find_run(PLAIN.sub("", list(row.values())[-1]).split("/")[-1]) / "metrics.csv")
    steps = np.array([int(r["env_steps"]) for r in rows])
    for title, said in row.items():
        if title.endswith(" M") and said:
            nearest = rows[np.abs(steps - 1e6 * float(title[:-2])).argmin()]
            expected = [float(nearest["train_types_success"]), float(nearest["left_out_success"])]
            numbers = [float(number) for number in re.findall(r"[\d.]+", said)]
            assert numbers == pytest.approx(expected[: len(numbers)], abs=0.0501), title


ENDS = [row for row in NAMED if row.get("left out") or row.get("zero-shot")]


@pytest.mark.parametrize("row", ENDS, ids=lambda row: PLAIN.sub("", list(row.values())[-1]))
def test_zero_shot_success_beside_a_curve_is_that_of_the_evaluation(row):
    name = PLAIN.sub("", list(row.values())[-1])
    found = [types for part in (name, f"{name}_jk") for types in read_evaluations(part)]
    if said := row.get("left out"):
        (letter,) = [letter for letter in ("E", "H", "I") if letter in found[0] and found[0][letter]["zero_shot"]]
        numbers = [(letter, said)]
    else:
        numbers = re.findall(r"([A-K]) ([\d.]+)", row["zero-shot"])
    assert numbers
    for letter, number in numbers:
        (mean,) = [types[letter]["success_mean"] for types in found if letter in types]
        assert abs(float(number) - mean) < 0.0501, letter

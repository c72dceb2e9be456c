"""What is published was trained with the settings that the experiment of its name has today."""

import pathlib
import re

import pytest

from hcp_jax.command_line import load_config, load_configs
from hcp_jax.config import Config, from_dict, to_dict
from hcp_jax.training import run_folder

ROOT = pathlib.Path(__file__).resolve().parents[2]
RUNS = sorted(path.parent for task in ("arms", "hopper") for path in (ROOT / "results" / task / "runs").glob("*/config.json"))
# What may differ in every run: its seed, where the policy that it starts from lay, and the name that a folder's may refine.
FREE = {"seed", "init", "name"}
# Runs of other settings than their experiment's: why, and in which fields.
OLDER = {
    "peg_hcpe_leave_h_s0": (
        "trained before the peg's preset had five-step returns, more episodes of arms that fail and larger steps",
        {
            "total_env_steps",
            "ddpg.actor_learning_rate",
            "ddpg.critic_learning_rate",
            "ddpg.batch_size",
            "ddpg.updates_per_iteration",
            "ddpg.n_step",
            "ddpg.n_step_from",
            "ddpg.failing_share",
            "ddpg.tau",
            "ddpg.actor_average",
        },
    ),
}


@pytest.fixture(scope="module")
def experiments() -> dict[str, Config]:
    """Every experiment by its file's name, or by its own where a list has it."""
    found = {}
    for path in sorted((ROOT / "experiments").glob("*.py")):
        if "def get_configs" in path.read_text():
            found |= {config.name: config for config in load_configs(str(path)) if config.name not in found}
        else:
            found[path.stem] = load_config(str(path))
    return found


def find_differences(one: Config, other: Config) -> set[str]:
    """Dotted names of the fields in which two configs differ, beside those in `FREE`."""
    return {name for name, *_ in run_folder.find_differences(one, other)} - FREE


def test_there_are_published_runs():
    assert len(RUNS) > 20


@pytest.mark.parametrize("folder", RUNS, ids=lambda folder: folder.name)
def test_a_published_run_has_the_settings_of_its_experiment(folder, experiments):
    name = re.sub(r"_s\d+$", "", folder.name)
    differences = find_differences(run_folder.read_config(folder), experiments[name])
    assert differences == OLDER.get(folder.name, ("", set()))[1]


def test_a_setting_that_differs_is_seen(experiments):
    config = experiments["reacher_hcpe_leave_h"]
    values = to_dict(config)
    values["seed"], values["ddpg"]["tau"], values["total_env_steps"] = 5, 0.5, 1_000_000
    assert find_differences(config, from_dict(Config, values)) == {"ddpg.tau", "total_env_steps"}


def test_each_experiment_of_table_1_has_a_link_by_its_number():
    names = [config.name for config in load_configs(str(ROOT / "experiments" / "table1.py"))]
    links = {f"exp{number:02d}_{('hcpe', 'ddpg')[(number - 1) % 2]}": f"{name}_s0" for number, name in enumerate(names, 1)}
    policies = ROOT / "results" / "policies"
    assert {path.name: path.readlink().name for path in policies.iterdir() if path.is_symlink()} == links
    assert all((policies / target / "policy.msgpack").is_file() for target in links.values())

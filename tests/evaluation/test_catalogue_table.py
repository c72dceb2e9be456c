import dataclasses
import json

import numpy as np
import pytest

from hcp_jax import catalogue
from hcp_jax.config import ArmPoolConfig, Config, ConfigError, to_dict
from hcp_jax.evaluation.arm_sweeps import evaluate_arms
from hcp_jax.evaluation.catalogue_table import make_catalogue_table, summarise
from hcp_jax.experiment.arm import make_own_pools
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.training import loop
from hcp_jax.training.metrics import read_rows

RANGES = ArmRanges(mass_ratio=(2.0, 2.0), damping=(1.0, 3.0), frictionloss=(0.5, 0.5), armature=(0.2, 0.2))


@pytest.fixture(scope="module")
def panda_config(tiny_arms, finished_arms) -> Config:
    pool = ArmPoolConfig(types=(), left_out=(), robots_per_type=1, heldout_per_type=3, ranges=RANGES)
    changes = {"name": "panda", "robot": "panda", "pool": pool, "init": str(finished_arms), "init_layers": "all"}
    return dataclasses.replace(tiny_arms, total_env_steps=40, eval_every=40, **changes)


@pytest.fixture(scope="module")
def panda_run(panda_config, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "panda"
    loop.train(panda_config, folder)
    return folder


def test_fine_tuning_trains_on_the_one_arm_and_evaluates_it(panda_run):
    (row,) = read_rows(panda_run / "metrics.csv")
    assert row["train_types_success"] == row["success_own"]
    with pytest.raises(ConfigError, match="--range: not with an arm from a file"):
        evaluate_arms(panda_run, trials=1, robots_per_trial=2, ranges=[("damping", 1.0, 2.0)])


def test_variants_of_an_arm_differ_in_masses_and_joint_dynamics_alone(panda_config):
    arm, _ = make_own_pools(panda_config)
    many = dataclasses.replace(panda_config, pool=dataclasses.replace(panda_config.pool, robots_per_type=4))
    variants, evaluated = make_own_pools(many)
    assert (arm.num_robots, variants.num_robots, evaluated.num_robots) == (1, 4, 3)
    np.testing.assert_allclose(variants.hardware["link_mass"], 2.0 * arm.hardware["link_mass"].repeat(4, axis=0))
    assert len(np.unique(variants.hardware["damping"])) == 4 * 7
    assert ((variants.hardware["damping"] >= 1.0) & (variants.hardware["damping"] <= 3.0)).all()
    for name in ("chain_pos", "chain_quat", "joint_range", "torque_limit", "start_angles"):
        np.testing.assert_array_equal(variants.hardware[name], arm.hardware[name].repeat(4, axis=0))
    np.testing.assert_array_equal(evaluated.hardware["damping"], arm.hardware["damping"].repeat(3, axis=0))


def test_an_arm_that_a_policy_was_trained_on_is_no_zero_shot(capsys):
    types = {
        name: {"success_mean": mean, "success_std": 1.0, "reachable_success_mean": None, "zero_shot": name != "sawyer"}
        for name, mean in (("panda", 10.0), ("sawyer", 90.0), ("ur5e", 30.0))
    }
    record = {"run": "policies/one", "checkpoint_env_steps": 7, "types": types}
    rows = [{"robot": name, "reachable_share": 99.0, "zero_shot": [summarise(record, name)]} for name in types]
    catalogue.print_table([row | {"fine_tuned": summarise(record, row["robot"]) if i else None} for i, row in enumerate(rows)])
    shown = capsys.readouterr().out
    assert "90.0 (trained on it)" in shown
    assert shown.count("trained on it") == 1
    assert "median zero-shot success: 20.0 %, one" in shown
    assert shown.count("n/a") == 1


@pytest.mark.slow
def test_the_table_has_each_arm_under_each_policy_and_the_fine_tuned_one_beside_them(
    finished_arms, panda_run, tmp_path, capsys
):
    path = tmp_path / "catalogue.json"
    arguments = ["--robots", "ur5e", "panda", "--trials", "2", "--episodes-per-trial", "2", "--json", str(path)]
    catalogue.main([str(finished_arms), str(finished_arms), "--fine-tuned", str(panda_run), *arguments])
    panda, ur5e = json.loads(path.read_text())
    assert (panda["robot"], panda["joints"], ur5e["robot"], ur5e["joints"]) == ("panda", 7, "ur5e", 6)
    assert [part["control_steps"] for part in (*panda["zero_shot"], panda["fine_tuned"])] == [320, 320, 40]
    assert panda["zero_shot"][0] == panda["zero_shot"][1]
    assert panda["fine_tuned"]["policy"] == str(panda_run)
    assert ur5e["fine_tuned"] is None
    assert 0.0 <= ur5e["reachable_share"] <= 100.0
    assert "median zero-shot success" in capsys.readouterr().out


def test_what_no_table_can_be_made_of_is_said(finished_arms, panda_run, tiny_config, tmp_path):
    with pytest.raises(ConfigError, match="--robots=pr2: expected arms out of fetch, gen3"):
        make_catalogue_table([finished_arms], names=["pr2"])
    with pytest.raises(ConfigError, match="not trained on an arm of the catalogue"):
        make_catalogue_table([finished_arms], fine_tuned=[finished_arms])
    with pytest.raises(ConfigError, match="is of panda too"):
        make_catalogue_table([finished_arms], fine_tuned=[panda_run, panda_run])
    with pytest.raises(ConfigError, match="panda: of panda, and --robots has sawyer, ur5e"):
        make_catalogue_table([finished_arms], fine_tuned=[panda_run], names=["ur5e", "sawyer"])
    (tmp_path / "config.json").write_text(json.dumps(to_dict(tiny_config)))
    with pytest.raises(ConfigError, match="a policy of hoppers"):
        make_catalogue_table([finished_arms, tmp_path])
    other = json.loads((finished_arms / "config.json").read_text()) | {"task": "peg_insertion"}
    (tmp_path / "config.json").write_text(json.dumps(other))
    with pytest.raises(ConfigError, match=r"of peg_insertion, and .* is of reacher; expected one task"):
        make_catalogue_table([finished_arms, tmp_path])

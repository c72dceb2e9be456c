import numpy as np
import pytest

from hcp_jax.config import ConfigError
from hcp_jax.evaluation.arm_sweeps import evaluate_arms
from hcp_jax.experiment.build import for_own_robots
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.catalogue import load_robot
from hcp_jax.hardware.ranges import ArmRanges


@pytest.fixture(scope="module")
def record(finished_arms) -> dict:
    return evaluate_arms(finished_arms, trials=2, robots_per_trial=2)


def test_each_type_has_its_row_and_the_one_left_out_is_marked_zero_shot(record):
    assert {name: row["zero_shot"] for name, row in record["types"].items()} == {"A": False, "I": False, "H": True}
    for name, row in record["types"].items():
        robots = [robot for robot in record["robots"] if robot["type"] == name]
        assert row["success_mean"] == 100.0 * np.mean([robot["success"] for robot in robots])
        assert row["final_distance_quantiles"]["1"] == pytest.approx(max(r["final_distance"] for r in robots), abs=1e-5)


def test_success_over_reachable_goals_counts_the_reachable_ones_alone(record):
    for name, row in record["types"].items():
        reachable = [robot["success"] for robot in record["robots"] if robot["type"] == name and robot["goal_reachable"]]
        assert row["reachable_success_mean"] == (100.0 * np.mean(reachable) if reachable else None)
        assert row["reachable_share"] == 25.0 * len(reachable)


def test_arms_with_an_immovable_joint_are_counted_and_left_out_of_the_others_success(record):
    for name, row in record["types"].items():
        movable = [robot["success"] for robot in record["robots"] if robot["type"] == name and not robot["immovable_joints"]]
        assert row["movable_success_mean"] == (100.0 * np.mean(movable) if movable else None)
        assert row["immovable_share"] == 100.0 - 25.0 * len(movable)


def test_a_joint_is_immovable_where_friction_exceeds_its_torque_limit(record):
    for robot in record["robots"]:
        hardware = {name: np.asarray(values) for name, values in robot["hardware"].items()}
        expected = (hardware["frictionloss"] > hardware["torque_limit"]) & (hardware["joint_mask"] > 0)
        assert robot["immovable_joints"] == np.flatnonzero(expected).tolist()


def test_new_arms_are_drawn_from_the_ranges_asked_for(finished_arms):
    record = evaluate_arms(finished_arms, 1, 2, types=("I",), ranges=[("damping", 30.0, 40.0)])
    damping = np.asarray([robot["hardware"]["damping"] for robot in record["robots"]])
    assert ((damping >= 30.0) & (damping <= 40.0)).all()


def test_a_saved_pool_is_played_in_order_type_by_type(finished_arms, tmp_path):
    pool = make_arm_pool("reacher", ArmRanges(), ("I", "B"), 2, seed=5)
    pool.save(tmp_path / "pool")
    record = evaluate_arms(finished_arms, 1, 3, pool_folder=tmp_path / "pool")
    assert [robot["robot_id"] for robot in record["robots"]] == [*pool.robot_id[[0, 1, 0, 2, 3, 2]]]
    assert [robot["type"] for robot in record["robots"]] == ["I"] * 3 + ["B"] * 3
    with pytest.raises(ConfigError, match="the pool has robots of type I, B"):
        evaluate_arms(finished_arms, 1, 3, types=("H",), pool_folder=tmp_path / "pool")


def test_an_arm_from_a_file_is_played_the_same_whether_or_not_the_training_arms_are_built(finished_arms, monkeypatch):
    settings = {"trials": 1, "robots_per_trial": 3, "own_robots": {"panda": load_robot("panda")}}
    sooner = evaluate_arms(finished_arms, **settings)
    built = []
    monkeypatch.setattr("hcp_jax.evaluation.arm_sweeps.for_own_robots", lambda config: built.append(config) or config)
    assert evaluate_arms(finished_arms, **settings) == sooner
    assert for_own_robots(built[0]).pool.num_robots < built[0].pool.num_robots

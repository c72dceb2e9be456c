import dataclasses
import json

import mujoco
import numpy as np
import pytest

from hcp_jax import rehearse
from hcp_jax.config import ArmConfig
from hcp_jax.evaluation.rehearsal import CONDITIONS, IDEAL, REAL, Conditions, make_model, play
from hcp_jax.experiment.chosen_robots import ChosenRobot
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.ranges import ArmRanges

FAR = np.array([5.0, 0.0, 0.0])  # [m] a goal that nothing reaches


@pytest.fixture(scope="module")
def arm() -> ChosenRobot:
    """An arm of type A without friction, which sags at once where nothing carries it."""
    ranges = dataclasses.replace(ArmRanges(), frictionloss=(0.0, 0.0), damping=(0.1, 0.1))
    return ChosenRobot("A:0", make_arm_pool("reacher", ranges, ("A",), 1, seed=0), tuple("abcde"))


def play_still(arm: ChosenRobot, conditions: Conditions, steps: int, act=lambda _: np.zeros(5)):
    """An episode of an arm that starts stretched out."""
    model = make_model(arm, conditions)
    return play(model, act, np.zeros(5), FAR, conditions, ArmConfig(episode_length=steps), np.random.default_rng(0))


def test_gravity_compensation_holds_an_arm_without_torques(arm):
    seen = {}
    for name, compensated in (("carried", True), ("left", False)):

        def act(observation, name=name):
            seen[name] = observation[:5]
            return np.zeros(5)

        play_still(arm, Conditions(gravity_compensation=compensated), 20, act)
    assert np.abs(seen["carried"]).max() < 1e-4
    assert np.abs(seen["left"]).max() > 0.1


def test_torques_arrive_the_delay_later(arm, monkeypatch):
    applied = []
    step = mujoco.mj_step

    def record(model, data, nstep):
        applied.append(round(float(data.ctrl[0]), 4))
        step(model, data, nstep=nstep)

    monkeypatch.setattr(mujoco, "mj_step", record)
    count = iter(range(1, 100))
    play_still(arm, Conditions(delay=2), 5, lambda _: np.full(5, 0.8 * next(count)))  # 1 % of the limit of joint 0 each
    assert applied == [0.0, 0.0, 0.01, 0.02, 0.03]


def test_jitter_changes_the_periods_and_not_their_mean(arm, monkeypatch):
    periods = []
    monkeypatch.setattr(mujoco, "mj_step", lambda model, data, nstep: periods.append(nstep))
    play_still(arm, Conditions(jitter=0.005), 400)
    assert (min(periods), max(periods)) == (15, 25)
    assert np.mean(periods) == pytest.approx(20.0, abs=0.5)
    periods.clear()
    play_still(arm, IDEAL, 10)
    assert periods == [20] * 10


def test_the_sensors_noise_is_on_the_observation_alone(arm):
    observations = []
    conditions = dataclasses.replace(REAL, jitter=0.0)
    play_still(arm, conditions, 300, lambda observation: observations.append(observation) or np.zeros(5))
    spread = np.std(observations, axis=0)
    np.testing.assert_allclose(spread[:5], REAL.angle_noise, rtol=0.2)
    np.testing.assert_allclose(spread[5:10], REAL.velocity_noise, rtol=0.2)
    np.testing.assert_allclose(spread[10:], 0.0, atol=1e-6)


def test_an_episode_ends_where_the_goal_is_reached(arm):
    model = make_model(arm, REAL)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    goal = data.site("ref_pt").xpos.copy()
    trial = play(model, lambda _: np.zeros(5), np.zeros(5), goal, REAL, ArmConfig(), np.random.default_rng(0))
    assert (trial.success, trial.episode_length) == (True, 1)


def test_an_arm_whose_physics_diverges_fails_though_mujoco_resets_it_to_where_the_goal_is(arm):
    model = make_model(arm, IDEAL)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    goal = data.site("ref_pt").xpos.copy()
    start = np.array([1.0, 1.0, 1.0, 1.0, 2e10])  # [rad] the last one beyond what MuJoCo takes
    trial = play(model, lambda _: np.zeros(5), start, goal, IDEAL, ArmConfig(), np.random.default_rng(0))
    assert (trial.success, trial.episode_length) == (False, 0)
    assert np.isfinite(trial.final_distance)


def test_real_conditions_are_the_parts_that_are_also_tried_alone():
    parts = [dataclasses.asdict(CONDITIONS[name]) for name in CONDITIONS if name not in ("ideal", "real")]
    ideal, together = dataclasses.asdict(IDEAL), {}
    for part in parts:
        together |= {name: value for name, value in part.items() if value != ideal[name]}
    assert together == dataclasses.asdict(REAL)


def test_success_and_distances_of_each_condition_are_shown(capsys):
    quantiles = {"0.5": 0.013, "1": 0.25}
    conditions = {name: {"success": 70.0 + i, "final_distance_quantiles": quantiles} for i, name in enumerate(CONDITIONS)}
    rehearse.print_record({"run": "policies/one", "robot": "H:1", "conditions": conditions})
    shown = capsys.readouterr().out
    assert all(name in shown for name in ("policies/one on H:1", "50%", "100%", "0.013", "0.250", *CONDITIONS))
    assert [f"{70 + i}" in shown for i in range(len(CONDITIONS))] == [True] * len(CONDITIONS)


@pytest.mark.slow
def test_the_command_writes_each_goal_under_all_conditions(finished_arms, tmp_path, capsys):
    rehearse.main([str(finished_arms), "--robot", "H:1", "--goals", "3", "--json", str(tmp_path / "record.json")])
    record = json.loads((tmp_path / "record.json").read_text())
    assert list(record["conditions"]) == list(CONDITIONS)
    for row in record["conditions"].values():
        distances = [trial["final_distance"] for trial in row["trials"]]
        assert len(distances) == 3
        assert row["final_distance_quantiles"]["1"] == max(distances)
    goals = [[trial["goal"] for trial in row["trials"]] for row in record["conditions"].values()]
    assert all(one == goals[0] for one in goals)
    assert "H:1" in capsys.readouterr().out

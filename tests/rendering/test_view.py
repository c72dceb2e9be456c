import sys

import numpy as np
import pytest
import viser

from hcp_jax import view
from hcp_jax.experiment.build import make_experiment
from hcp_jax.hardware.arm import LINKS
from hcp_jax.rendering.browser import ArmView
from hcp_jax.rendering.live import make_one_arm
from hcp_jax.training.policy_file import load_policy
from hcp_jax.training.run_folder import read_config


@pytest.fixture(scope="module")
def arm_view(finished_arms):
    run = make_experiment(read_config(finished_arms))
    server = viser.ViserServer(host="localhost", port=18080, verbose=False)
    yield ArmView(server, run, run.learner.policy(load_policy(finished_arms, run)[1]))
    server.stop()


def shape_positions(arm_view: ArmView) -> np.ndarray:
    return np.stack([shape.position for shape in arm_view.shapes.values()])


def test_the_shapes_move_with_the_arm(arm_view):
    before, angles = shape_positions(arm_view), arm_view.arm.qpos
    for _ in range(10):
        arm_view.tick()
    assert np.abs(arm_view.arm.qpos - angles).max() > 1e-3
    assert np.abs(shape_positions(arm_view) - before).max() > 1e-4


def test_type_and_lengths_make_another_arm_and_the_goal_stays(arm_view, monkeypatch):
    goal = arm_view.arm.goal
    arm_view.robot_type.value = "H"
    arm_view.lengths["l2"].value = 0.1
    assert arm_view.arm.pool.hardware["type"][0, 0] == 0
    monkeypatch.setattr("hcp_jax.rendering.browser.SETTLE_SECONDS", 0.0)
    arm_view.lengths["l4"].value = -0.05
    arm_view.tick()
    change = np.zeros(10)
    change[LINKS.index("l2")], change[LINKS.index("l4")] = 0.1, -0.05
    expected = make_one_arm("reacher", "H", change)
    np.testing.assert_allclose(arm_view.arm.pool.hardware["chain_pos"], expected.hardware["chain_pos"])
    arm_view.new_pose.value = True
    arm_view.tick()
    np.testing.assert_allclose(arm_view.arm.goal, goal)
    np.testing.assert_allclose(arm_view.gizmo.position, goal, atol=1e-6)


def test_a_dragged_goal_is_the_one_that_the_policy_sees(arm_view):
    arm_view.ask_goal(np.array([0.5, -0.2, 0.1]))
    arm_view.tick()
    np.testing.assert_allclose(arm_view.arm.goal, [0.5, -0.2, 0.1], atol=1e-6)
    tip = np.asarray(arm_view.arm.state.achieved_goal[0])
    assert arm_view.arm.distance == pytest.approx(np.linalg.norm(tip - [0.5, -0.2, 0.1]), abs=1e-5)
    arm_view.ask_goal(np.array([5.0, 0.0, 0.1]))
    arm_view.tick()
    np.testing.assert_allclose(arm_view.arm.goal, [0.6, 0.0, 0.1], atol=1e-6)


def fails(capsys, arguments) -> str:
    """Runs the command, which must end with code 2 and one line; returns the line."""
    with pytest.raises(SystemExit) as exit_info:
        view.main([str(argument) for argument in arguments])
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


def test_bad_arguments_give_one_line(finished_run, finished_arms, tmp_path, capsys):
    assert "the view shows arms" in fails(capsys, [finished_run])
    assert "--port=0: expected 1 to 65535" in fails(capsys, [finished_run, "--port", "0"])
    assert "--host=10.99.99.99: expected an address of this machine" in fails(capsys, [finished_arms, "--host", "10.99.99.99"])
    assert "no such run folder" in fails(capsys, [tmp_path / "nowhere"])


def test_without_viser_one_line_names_the_extra(finished_arms, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert "extra viz: pip install viser" in fails(capsys, [finished_arms])

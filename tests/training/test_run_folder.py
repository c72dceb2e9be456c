import dataclasses
import json

import numpy as np
import pytest

from hcp_jax import presets
from hcp_jax.evaluation.groups import group_by_settings
from hcp_jax.experiment.arm import load_own_robot, own_robot_name
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.robot_file import RobotFileError, read_robot_here
from hcp_jax.training import loop, run_folder
from hcp_jax.training.run_folder import RunFolderError

TEMPLATE = robots_path() / "arm_reacher.xml"


def test_a_run_keeps_the_arm_that_its_file_said(tiny_arms, tmp_path):
    own = tmp_path / "own.xml"
    own.write_text(TEMPLATE.read_text())
    config = dataclasses.replace(tiny_arms, pool=presets.one_arm(1), robot=str(own), robot_tip="l6")
    run_folder.write_start(tmp_path / "run", config, "native")
    run_folder.check_resumable(tmp_path / "run", config)
    own.write_text(TEMPLATE.read_text().replace("-3.0503 3.0503", "-2 2"))
    with pytest.raises(RunFolderError, match="was started with another arm than robot="):
        run_folder.check_resumable(tmp_path / "run", config)
    own.unlink()
    kept = run_folder.read_config(tmp_path / "run")
    assert own_robot_name(kept) == "own"
    run_folder.check_resumable(tmp_path / "run", kept)
    np.testing.assert_array_equal(load_own_robot(kept).chain.pos, read_robot_here(TEMPLATE, None, "l6").chain.pos)
    path = tmp_path / "run" / "robot" / "own.json"
    record = json.loads(path.read_text())
    for field, change in (("weight", [1.0]), ("mass", [-1.0]), ("inertia", [[1.0, 0.1, 0.1]]), ("joint_range", [[1.0, -1.0]])):
        chain = record["chain"] | {field: change * len(record["joints"])}
        path.write_text(json.dumps(record | {"chain": chain}))
        with pytest.raises(RobotFileError, match=r"own\.json: damaged record of an arm"):
            load_own_robot(kept)


def test_seeds_on_the_same_arm_are_one_experiment_wherever_its_file_is(tiny_arms, tmp_path):
    for number, text in enumerate((TEMPLATE.read_text(), TEMPLATE.read_text(), TEMPLATE.read_text().replace("3.0503", "2"))):
        own = tmp_path / f"files{number}" / "own.xml"
        own.parent.mkdir()
        own.write_text(text)
        pool = presets.one_arm(1)
        config = dataclasses.replace(tiny_arms, pool=pool, robot=str(own), robot_tip="l6", seed=number)
        run_folder.write_start(tmp_path / f"run{number}", config, "native")
    groups = group_by_settings([tmp_path / f"run{number}" for number in range(3)], run_folder.read_config)
    assert [[folder.name for folder in group] for group in groups] == [["run0", "run1"], ["run2"]]


def test_an_arm_of_the_catalogue_with_another_tip_is_another_arm(tiny_arms, tmp_path):
    config = dataclasses.replace(tiny_arms, pool=presets.one_arm(1), robot="panda")
    other = dataclasses.replace(config, robot_tip="panda_link5")
    assert run_folder.find_differences(config, other) == [("robot_tip", "", "panda_link5")]
    assert [len(group) for group in group_by_settings([config, config, other], lambda config: config)] == [2, 1]
    run_folder.write_start(tmp_path, config, "native")
    with pytest.raises(RunFolderError, match="was started with robot_tip='', not 'panda_link5'"):
        run_folder.check_resumable(tmp_path, other)


@pytest.mark.parametrize("recorded", ["", "{}"])
def test_a_run_whose_engine_is_not_recorded_goes_on(recorded, tiny_config, tmp_path):
    run_folder.write_start(tmp_path, tiny_config, "native")
    (tmp_path / "environment.json").write_text(recorded)
    run_folder.check_physics(tmp_path, "mjx-warp")
    with pytest.raises(RunFolderError, match="was started with physics='auto', not 'native'"):
        run_folder.check_resumable(tmp_path, dataclasses.replace(tiny_config, physics="native"))


def test_a_run_goes_on_with_the_engine_that_it_was_started_on_alone(tiny_config, tmp_path):
    run_folder.write_start(tmp_path, tiny_config, "mjx-jax")
    refusal = "started on the engine mjx-jax, and here it is native; --config.physics=mjx-jax goes on with it"
    with pytest.raises(RunFolderError, match=refusal):
        loop.train(tiny_config, tmp_path, resume=True)
    named = dataclasses.replace(tiny_config, physics="mjx-jax")
    run_folder.check_resumable(tmp_path, named)
    run_folder.write_start(tmp_path, named, "mjx-jax")
    with pytest.raises(RunFolderError, match="was started with physics='mjx-jax', not 'native'"):
        run_folder.check_resumable(tmp_path, dataclasses.replace(named, physics="native"))


def test_of_more_steps_ddpg_says_that_the_switch_to_longer_returns_is_later(tiny_arms, tmp_path, capsys):
    ddpg = dataclasses.replace(tiny_arms.ddpg, n_step=5, n_step_from=0.5)
    config = dataclasses.replace(tiny_arms, ddpg=ddpg)
    run_folder.write_start(tmp_path, config, "native")
    loop._record_changes(tmp_path, dataclasses.replace(config, total_env_steps=400))
    assert "400 steps instead of 320: stretched over the new length: the decay of the step sizes and the switch to 5-step" in (
        capsys.readouterr().out
    )

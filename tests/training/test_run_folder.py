import dataclasses

import numpy as np
import pytest

from hcp_jax import presets
from hcp_jax.experiment.arm import load_own_robot, own_robot_name
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.robot_file import RobotFileError, read_robot_here
from hcp_jax.training import run_folder
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
    path.write_text(path.read_text().replace('"mass"', '"weight"'))
    with pytest.raises(RobotFileError, match=r"own\.json: damaged record of an arm"):
        load_own_robot(kept)

"""What `export` writes runs without the package, and does there what the package does."""

import dataclasses
import json
import pathlib
import shutil
import subprocess
import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from hcp_jax import export
from hcp_jax.deployment.robot_model import write_model
from hcp_jax.experiment.arm import make_evaluator, make_goal_conditioning, make_heldout_arms
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.chosen_robots import ChosenRobot, choose_robot
from hcp_jax.experiment.hopper import heldout_v_h, make_heldout_pool
from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy

ROOT = pathlib.Path(__file__).resolve().parents[2]
ARM = 3  # held-out robot of type H, which the policy was not trained on
# The consumer: neither this package nor what it builds networks with can be imported.
BLOCKED = "import sys\nfor name in ('hcp_jax', 'brax', 'flax', 'optax'): sys.modules[name] = None\n"
CONSUMER = """
import json, pathlib
import jax, numpy as np, onnxruntime
folder, observations, out = pathlib.Path(sys.argv[1]), np.load(sys.argv[2]), sys.argv[3]
description = json.loads((folder / "policy.json").read_text())
name = description["input"]["name"]
session = onnxruntime.InferenceSession(folder / "policy.onnx", providers=["CPUExecutionProvider"])
function = jax.export.deserialize(bytearray((folder / "policy.jax_export").read_bytes())).call
np.savez(out, onnx=[session.run(None, {name: row})[0] for row in observations], jax=[function(row) for row in observations])
"""


def smaller(policy: str, folder: pathlib.Path, **pool) -> pathlib.Path:
    """A published policy with a config of few robots, which is built faster. What the policy does, does not depend on them."""
    shutil.copytree(ROOT / "results" / "policies" / policy, folder)
    path = folder / "config.json"
    config = json.loads(path.read_text())
    config["pool"] |= pool
    if config["task"] != "hopper":
        config["ddpg"]["buffer_episodes"] = 128
        config["env"]["observation_noise"] = 0.0
    path.write_text(json.dumps(config))
    return folder


@pytest.fixture(scope="module")
def arm_run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("policies") / "reacher"
    return smaller("reacher_hcpe_leave_h_s0", folder, robots_per_type=1, heldout_per_type=1)


@pytest.fixture(scope="module")
def loaded(arm_run):
    """The package's own: run, state, and held-out robots 0 to 3 of type H."""
    run = make_experiment(run_folder.read_config(arm_run), "native")
    return run, load_policy(arm_run, run)[1], make_heldout_arms(run.config, ("H",), ARM + 1)


@pytest.fixture(scope="module")
def loaded_once(loaded):
    """The command takes what is loaded already; that it loads by itself is the hopper's test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hcp_jax.deployment.artefacts.make_experiment", lambda *_: loaded[0])
        patch.setattr("hcp_jax.deployment.artefacts.load_policy", lambda *_: (1, loaded[1]))
        yield


@pytest.fixture(scope="module")
def exported(arm_run, loaded_once, tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("exported") / "arm"
    export.main([str(arm_run), "--robot", f"H:{ARM}", "--out", str(folder)])
    return folder


@pytest.fixture(scope="module")
def description(exported) -> dict:
    return json.loads((exported / "policy.json").read_text())


def consume(folder: pathlib.Path, observations: np.ndarray, scratch: pathlib.Path) -> dict[str, np.ndarray]:
    """What both artefacts answer in a process without this package."""
    np.save(scratch / "observations.npy", observations.astype(np.float32))
    command = [sys.executable, "-c", BLOCKED + CONSUMER, folder, scratch / "observations.npy", scratch / "torques.npz"]
    subprocess.run(command, check=True, cwd=scratch)
    return dict(np.load(scratch / "torques.npz"))


def test_both_artefacts_answer_as_the_package_does(exported, loaded, description, tmp_path, rng):
    run, state, pool = loaded
    starts = np.asarray(description["start_angles"])
    count, rows = starts.shape[1], rng.integers(0, len(starts), 40)
    angles, velocities = starts[rows] + 0.3 * rng.normal(size=(40, count)), rng.normal(size=(40, count))
    goals = rng.uniform(description["goal"]["low"], description["goal"]["high"], (40, 3))
    observations = np.concatenate([angles, velocities, goals], axis=1).astype(np.float32)
    conditioning = make_goal_conditioning(run.config, pool, run.train_pool)
    padding = np.zeros((40, 7 - count))
    padded = np.concatenate([angles, padding, velocities, padding], axis=1).astype(np.float32)
    action = run.learner.mean_action(
        *run.learner.policy(state), conditioning, jnp.full(40, ARM), padded, goals.astype(np.float32)
    )
    limits = [entry["limit"] for entry in description["output"]["entries"]]
    assert np.abs(action).max() > 0.5
    example = description["example"]
    for answers in consume(exported, np.vstack([observations, example["observation"]]), tmp_path).values():
        np.testing.assert_allclose(answers[:-1] / limits, action[:, :count], atol=1e-5)
        np.testing.assert_allclose(answers[-1] / limits, np.divide(example["torque"], limits), atol=1e-5)


def test_the_description_names_what_goes_in_and_comes_out(description):
    joints = ["j0", "j1", "j2", "j3", "j4", "j6"]
    entries = description["input"]["entries"]
    assert [entry["name"] for entry in entries[:6]] == [f"angle of {joint}" for joint in joints]
    assert [entry["unit"] for entry in entries] == ["rad"] * 6 + ["rad/s"] * 6 + ["m"] * 3
    assert [entry["limit"] for entry in description["output"]["entries"]] == [80.0, 80.0, 40.0, 40.0, 9.0, 9.0]
    assert (description["control_period"], description["episode_length"]) == (pytest.approx(0.02), 200)
    assert description["commit"] == run_folder.read_commit()


def test_the_example_without_the_package_reaches_the_goals_that_the_package_reaches(exported, loaded, description):
    run, state, pool = loaded
    index, key = np.full(12, ARM), jax.random.key(5)
    evaluator = make_evaluator(run.config, run.learner, run.make_env, pool, run.train_pool)
    episodes = evaluator(run.learner.policy(state), index, key)
    poses = np.asarray(evaluator.env.reset(key, jnp.asarray(index)).physics.qpos)[:, :6]
    starts = np.asarray(description["start_angles"])
    reached = np.flatnonzero(episodes.success)[:2]
    assert len(reached) == 2
    for row in reached:
        start = int(np.abs(starts - poses[row]).max(axis=1).argmin())
        np.testing.assert_allclose(starts[start], poses[row], atol=1e-5)
        arguments = ["--start", str(start), "--goal", *map(repr, episodes.desired_goal[row].tolist())]
        result = run_example(exported, arguments)
        assert result["reached"]
        assert result["distance"] < 0.02
        assert abs(result["steps"] - int(episodes.episode_length[row])) <= 1


def run_example(folder: pathlib.Path, arguments: list[str]) -> dict:
    script = ROOT / "docs" / "examples" / "close_the_loop.py"
    program = f"{BLOCKED}import runpy\nsys.modules['jax'] = None\nrunpy.run_path({str(script)!r}, run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", program, folder, *arguments], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def test_the_arms_model_moves_as_the_padded_one(exported, loaded, rng):
    _, _, pool = loaded
    padded = pool.models()[ARM]
    check_same_motion(padded, (exported / "robot.xml").read_text(), pool.hardware["torque_limit"][ARM], rng)


def check_same_motion(padded: mujoco.MjModel, text: str, limits: np.ndarray, rng) -> None:
    """Random torques for a second move both equally."""
    model = mujoco.MjModel.from_xml_string(text)
    ours, theirs = mujoco.MjData(model), mujoco.MjData(padded)
    assert (model.opt.timestep, model.opt.integrator) == (padded.opt.timestep, padded.opt.integrator)
    for _ in range(50):
        action = rng.uniform(-0.3, 0.3, padded.nu)
        theirs.ctrl[:], ours.ctrl[:] = action, (action * limits)[: model.nu]
        mujoco.mj_step(padded, theirs, nstep=5)
        mujoco.mj_step(model, ours, nstep=5)
    assert np.abs(ours.qpos).max() > 0.1
    np.testing.assert_allclose(ours.qpos, theirs.qpos[: model.nq], atol=2e-4)
    np.testing.assert_allclose(ours.site("ref_pt").xpos, theirs.site("ref_pt").xpos, atol=2e-4)


@pytest.mark.parametrize("robot_type", ["A", "I"])
def test_a_peg_and_its_table_come_along(robot_type, rng):
    pool = make_arm_pool("peg_insertion", ArmRanges(), (robot_type,), 1, seed=0)
    joints = tuple(f"joint {i}" for i in range(int(pool.hardware["joint_mask"].sum())))
    text = write_model(ChosenRobot("x", pool, joints), 0.004, "implicitfast")
    model = mujoco.MjModel.from_xml_string(text)
    assert [model.joint(i).name for i in range(model.njnt)] == list(joints)
    assert model.nmocap == 1
    assert model.geom("peg").bodyid == model.body("tool").id
    padded = pool.models()[0]
    padded.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    text = text.replace("<option ", '<option ><flag contact="disable"/></option><option ')
    check_same_motion(padded, text, pool.hardware["torque_limit"][0], rng)


def test_ones_own_arm_keeps_the_names_of_its_joints(loaded):
    robot = choose_robot(loaded[0], str(robots_path() / "arm_reacher.xml"), tip="l6")
    assert robot.joints == tuple(f"j{i}" for i in range(7))
    assert robot.pool.num_robots == 1


def test_joints_may_be_called_as_other_joints_slots(loaded):
    names = ("slot1", "slot2", "slot0", "slot3", "slot4", "slot5", "slot6")
    robot = choose_robot(loaded[0], str(robots_path() / "arm_reacher.xml"), tip="l6")
    model = mujoco.MjModel.from_xml_string(write_model(dataclasses.replace(robot, joints=names), 0.004, "euler"))
    assert tuple(model.joint(i).name for i in range(7)) == tuple(model.actuator(i).name for i in range(7)) == names
    assert [int(model.actuator(i).trnid[0]) for i in range(7)] == list(range(7))


BAD_ROBOTS = {
    "K:0": "--robot=K:0: expected types out of A, B, C, D, E, F, G, H, I, R4, R5, R6, R7, train for reacher",
    "train:8": "--robot=train:8: expected a row from 0 to 7",
    "nowhere.urdf": "no such file",
}


def test_bad_robots_and_folders_that_exist_give_one_line(arm_run, exported, tmp_path, capsys):
    for robot, expected in BAD_ROBOTS.items():
        assert expected in fails(capsys, [str(arm_run), "--robot", robot, "--out", str(tmp_path / "out")])
    arguments = [str(arm_run), "--robot", "H:0", "--tip", "x", "--out", str(tmp_path / "out")]
    assert "--base, --tip: go with a file" in fails(capsys, arguments)
    assert list(tmp_path.iterdir()) == []
    before = (exported / "policy.json").read_bytes()
    assert "already exists" in fails(capsys, [str(arm_run), "--robot", "H:0", "--out", str(exported)])
    assert (exported / "policy.json").read_bytes() == before


def fails(capsys, arguments: list[str]) -> str:
    with pytest.raises(SystemExit) as exit_info:
        export.main(arguments)
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


@pytest.mark.slow
def test_a_hoppers_policy_answers_as_the_package_does(tmp_path, rng):
    folder = smaller("hopper_hcpe_dyn_s0", tmp_path / "hopper", num_robots=8, num_heldout=2)
    export.main([str(folder), "--robot", "hopper:2", "--out", str(tmp_path / "out")])
    run = make_experiment(run_folder.read_config(folder), "native")
    state = load_policy(folder, run)[1]
    pool = make_heldout_pool(run.config.pool, 3)
    observations = rng.normal(size=(20, 11)).astype(np.float32)
    v_h = jnp.tile(heldout_v_h(run, state.params, pool)[2], (20, 1))
    action = np.clip(run.learner.mean_action(state.params["network"], state.obs_statistics, observations, v_h), -1, 1)
    for answers in consume(tmp_path / "out", observations, tmp_path).values():
        np.testing.assert_allclose(answers / 200.0, action, atol=1e-5)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "robot.xml"))
    np.testing.assert_allclose(model.body_mass, pool.fields["body_mass"][2], rtol=1e-4)
    np.testing.assert_allclose(model.actuator_ctrlrange, [[-200.0, 200.0]] * 3)

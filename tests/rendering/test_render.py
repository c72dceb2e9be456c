import re
import subprocess
import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from imageio_ffmpeg import get_ffmpeg_exe
from PIL import Image

from hcp_jax import render
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.chosen_robots import Choice
from hcp_jax.hardware.pool import robots_path
from hcp_jax.rendering import film, graphics
from hcp_jax.rendering.drawing import OPEN_GOAL
from hcp_jax.rendering.film import frame_steps, open_painters, write_film
from hcp_jax.rendering.recording import Recording, record_episodes
from hcp_jax.training.policy_file import load_policy
from hcp_jax.training.run_folder import read_config


@pytest.fixture(scope="module")
def backend() -> str:
    try:
        return graphics.choose_backend()
    except graphics.GraphicsError as error:
        pytest.skip(f"this machine has no OpenGL: {error}")


@pytest.fixture(scope="module")
def recording(finished_arms) -> Recording:
    return record_episodes(finished_arms, [Choice("H", 1), Choice("A", 0)])


def fails(capsys, arguments) -> str:
    """Runs the command, which must end with code 2 and one line; returns the line."""
    with pytest.raises(SystemExit) as exit_info:
        render.main([str(argument) for argument in arguments])
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


def test_the_chosen_robots_are_recorded_in_order(recording):
    assert recording.names == ("H:1 (zero-shot)", "A:0")
    assert recording.pool.robot_id.tolist() == [1_070_001, 1_000_000]
    assert recording.ctrl_dt == pytest.approx(0.02)
    assert recording.qpos.shape == (recording.length.max() + 1, 2, 7)
    assert (recording.qpos[0] != recording.qpos[recording.length.min()]).any()


def test_record_plays_the_episodes_that_evaluation_plays(finished_arms, finished_run, key):
    for folder in (finished_arms, finished_run):
        run = make_experiment(read_config(folder))
        state = load_policy(folder, run)[1]
        if folder is finished_arms:
            arguments = (run.learner.policy(state),)
        else:
            arguments = ((state.params["network"], state.obs_statistics), jnp.zeros((2, 3)))
        arguments += (np.array([0, 3]), key)
        played = run.evaluator(*arguments)
        recorded, states = run.evaluator.record(*arguments)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-4), recorded, played)
        assert states.qpos.shape[:2] == (played.episode_length.max() + 1, 2)


def test_an_arms_states_end_as_far_from_the_goal_as_its_outcome_says(recording):
    for row, model in enumerate(recording.pool.models()):
        data = mujoco.MjData(model)
        data.qpos[:] = recording.qpos[recording.length[row], row]
        mujoco.mj_kinematics(model, data)
        distance = np.linalg.norm(data.site("ref_pt").xpos - recording.goal[row])
        assert recording.outcomes[row] == f"{100 * distance:.0f} cm away"


def test_a_hoppers_states_earn_what_its_outcome_says(finished_run):
    recording = record_episodes(finished_run, [Choice("hopper", 2), Choice("train", 5), Choice("hopper", 0)])
    assert recording.pool.robot_id.tolist() == [1_000_002, 5, 1_000_000]
    assert recording.names == ("hopper:2", "train:5", "hopper:0")
    # A control step earns its velocity and 1 for being up, and loses at most 3e-3 for its action.
    for row, outcome in enumerate(recording.outcomes):
        steps = int(recording.length[row])
        forward = float(recording.qpos[steps, row, 0] - recording.qpos[0, row, 0]) / recording.ctrl_dt
        total = float(re.match(r"return (-?\d+),", outcome)[1])
        assert forward + steps - 3e-3 * steps - 0.6 < total <= forward + steps + 0.6


def test_an_mp4_has_a_frame_for_every_step_shown_and_the_arms_move_in_it(recording, backend, tmp_path):
    path = tmp_path / "new" / "film.mp4"
    write_film(recording, path, backend)
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    command = [get_ffmpeg_exe(), "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    decoded = subprocess.run(command, capture_output=True, check=True).stdout
    frames = np.frombuffer(decoded, np.uint8).reshape(-1, 240, 640, 3)
    assert len(frames) == len(frame_steps(recording))
    check_that_both_arms_move(frames[0], frames[-1])


def test_a_gif_starts_and_ends_as_the_episodes_do(recording, backend, tmp_path):
    write_film(recording, tmp_path / "film.gif", backend)
    with Image.open(tmp_path / "film.gif") as gif:
        assert gif.size == (640, 240)
        first = np.asarray(gif.convert("RGB"))
        milliseconds = 0
        for i in range(gif.n_frames):
            gif.seek(i)
            milliseconds += gif.info["duration"]
        assert milliseconds == 40 * len(frame_steps(recording))
        check_that_both_arms_move(first, np.asarray(gif.convert("RGB")))


def check_that_both_arms_move(first: np.ndarray, last: np.ndarray) -> None:
    """The pictures of both arms differ, and not in the captions alone."""
    changed = np.abs(last.astype(int) - first).max(axis=2)[30:] > 40
    assert changed[:, :320].sum() > 50
    assert changed[:, 320:].sum() > 50


def test_a_video_that_cannot_be_encoded_leaves_no_file(recording, backend, tmp_path, monkeypatch):
    monkeypatch.setattr(film, "frame_steps", lambda recording: [0, 1])
    monkeypatch.setattr(film, "FRAME_RATE", -1)  # which no video has
    with pytest.raises(graphics.GraphicsError, match="ffmpeg ended with"):
        write_film(recording, tmp_path / "film.mp4", backend)
    assert list(tmp_path.iterdir()) == []


def test_a_strip_has_a_row_of_pictures_for_each_robot(recording, backend, tmp_path):
    write_film(recording, tmp_path / "strip.png", backend, num_pictures=3)
    with Image.open(tmp_path / "strip.png") as strip:
        assert strip.size == (3 * 320, 2 * 240)
        assert strip.getextrema() != ((255, 255),) * 3


def test_arm_and_goal_are_in_the_picture(recording, backend):
    """The goal's colour is where the camera's geometry puts the goal, and all bodies lie within the field of view."""
    with open_painters(recording, backend) as painters:
        for row, painter in enumerate(painters):
            image = np.asarray(painter.draw(0)).astype(int)
            pixels = project(painter.camera, np.concatenate(painter.bodies), image.shape[:2])
            assert (pixels >= 0).all()
            assert (pixels < [image.shape[1], image.shape[0]]).all()
            x, y = project(painter.camera, recording.goal[row][None], image.shape[:2])[0].astype(int)
            red, green, blue = image[y, x]
            assert red > green > blue, (OPEN_GOAL, image[y, x])


def project(camera: mujoco.MjvCamera, points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Pixels [P, 2] of points [P, 3] in a picture of `shape` (height, width), for a vertical field of view of 45 degrees."""
    azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    offset = points - (camera.lookat - camera.distance * forward)
    scale = shape[0] / 2 / np.tan(np.radians(22.5)) / (offset @ forward)
    return np.stack([shape[1] / 2 + scale * (offset @ right), shape[0] / 2 - scale * (offset @ np.cross(right, forward))], 1)


def test_an_own_arm_is_filmed_from_its_file(finished_arms, backend, tmp_path, capsys):
    out, file = tmp_path / "own.png", robots_path() / "arm_reacher.xml"
    render.main([str(finished_arms), "--robot", str(file), "--tip", "l6", "--out", str(out), "--pictures", "1"])
    assert "arm_reacher: " in capsys.readouterr().out
    with Image.open(out) as picture:
        assert picture.size == (640, 480)


BAD_ARGUMENTS = {
    "no robot": (["--out", "x.gif"], "--robots --grid --robot"),
    "two kinds": (["--grid", "--robots", "H:0", "--out", "x.gif"], "not allowed with"),
    "no row": (["--robots", "H3", "--out", "x.gif"], "--robots=H3: expected TYPE:ROW, such as H:3"),
    "negative row": (["--robots", "H:-3", "--out", "x.gif"], "--robots=H:-3: expected TYPE:ROW"),
    "row out of range": (["--robots", "H:10000", "--out", "x.gif"], "--robots=H:10000: expected a row from 0 to 9999"),
    "unknown type": (["--robots", "Q:0", "--out", "x.gif"], "--robots=Q:0: expected types out of A, B,"),
    "an arm with a peg": (["--robots", "J:0", "--out", "x.gif"], "--robots=J:0: expected types out of A, B,"),
    "twice": (["--robots", "H:0", "H:0", "--out", "x.gif"], "--robots=H:0: named twice"),
    "too many": (["--robots", *(f"H:{i}" for i in range(65)), "--out", "x.gif"], "65 of them: expected at most 64"),
    "format": (["--grid", "--out", "x.avi"], "--out=x.avi: expected a name that ends in .mp4, .gif, .png"),
    "pictures": (["--grid", "--out", "x.png", "--pictures", "0"], "--pictures=0: expected at least 1"),
    "missing file": (["--robot", "nowhere.urdf", "--out", "x.gif"], "nowhere.urdf: no such file"),
}


@pytest.mark.parametrize("name", BAD_ARGUMENTS)
def test_bad_arguments_give_one_line_and_write_nothing(name, finished_arms, tmp_path, capsys, monkeypatch):
    arguments, expected = BAD_ARGUMENTS[name]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(render, "choose_backend", lambda: "egl")  # what is asked for is looked at before anything is drawn
    assert expected in fails(capsys, [finished_arms, *arguments])
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_left_alone(finished_arms, tmp_path, capsys):
    (tmp_path / "old.gif").write_text("mine")
    assert "already exists; choose another name" in fails(capsys, [finished_arms, "--grid", "--out", tmp_path / "old.gif"])
    assert (tmp_path / "old.gif").read_text() == "mine"


def test_without_opengl_one_line_names_the_debian_packages(finished_arms, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(graphics, "_PROBE", "raise ImportError('no library')")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    line = fails(capsys, [finished_arms, "--grid", "--out", tmp_path / "x.gif"])
    assert "apt-get install libegl1" in line
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert "MUJOCO_GL=osmesa does not draw" in fails(capsys, [finished_arms, "--grid", "--out", tmp_path / "x.gif"])
    monkeypatch.setenv("MUJOCO_GL", "glx")
    assert "MUJOCO_GL=glx: expected one of egl," in fails(capsys, [finished_arms, "--grid", "--out", tmp_path / "x.gif"])


def test_without_the_encoder_one_line_names_the_extra(finished_arms, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    line = fails(capsys, [finished_arms, "--grid", "--out", tmp_path / "x.mp4"])
    assert "extra viz: pip install imageio-ffmpeg" in line

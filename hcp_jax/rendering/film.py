"""Videos and strips of pictures of recorded episodes."""

import contextlib
import itertools
import math
import pathlib
import subprocess
import tempfile
from collections.abc import Iterator

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from hcp_jax.rendering.drawing import make_drawing, put_goal
from hcp_jax.rendering.graphics import GraphicsError, renderer_class
from hcp_jax.rendering.recording import Recording

FORMATS = (".mp4", ".gif", ".png")
FRAME_RATE = 25  # [1/s]: every second state of an arm, every fifth of a hopper
MAX_ROBOTS = 64
_LAST_FRAME_SECONDS = 1.0  # how long the end is shown
_LARGE, _SMALL = (640, 480), (320, 240)  # width and height of a picture of one robot, and of one of several
_TRAIL_RADIUS, _TRAIL_COLOUR = 0.004, np.array([0.8, 0.2, 0.15, 1.0], np.float32)  # of the path of the point of interest
_ARM_VIEW, _HOPPER_VIEW = (118.0, -16.0), (90.0, -8.0)  # azimuth and elevation [degrees]
_MARGIN = 1.25  # of the field of view over what has to be seen: links have a width, and there is the caption
_HOPPER_ROOM = 1.2  # height of the picture over that of a hopper's highest joint
_ASPECT = _LARGE[0] / _LARGE[1]
_FIELD_OF_VIEW = 45.0  # [degrees] vertical, MuJoCo's default
_CAPTION_COLOUR, _SUCCESS_COLOUR = (25, 30, 40), (10, 110, 40)


def check_output(path: pathlib.Path) -> None:
    """Raises GraphicsError unless a file of that name can be written here: a known format, its encoder, no file yet."""
    if path.suffix not in FORMATS:
        raise GraphicsError(f"--out={path}: expected a name that ends in {', '.join(FORMATS)}")
    if path.exists():
        raise GraphicsError(f"--out={path}: already exists; choose another name")
    if path.suffix == ".mp4":
        try:
            from imageio_ffmpeg import get_ffmpeg_exe

            get_ffmpeg_exe()
        except (ImportError, RuntimeError) as error:
            raise GraphicsError(
                f"--out={path}: .mp4 needs the extra viz: pip install imageio-ffmpeg (a .gif needs nothing)"
            ) from error


def write_film(recording: Recording, path: pathlib.Path, backend: str, num_pictures: int = 5) -> None:
    """Draws a recording into an `.mp4` or `.gif`, or as a `.png` with a row of `num_pictures` for each robot.

    Args:
        recording: at most `MAX_ROBOTS` robots.
        path: a file that does not exist yet; its folder is made.
        backend: as of `choose_backend`.
        num_pictures: in a `.png`; 1 shows the ends of all episodes in a grid.

    Raises:
        GraphicsError: the file exists or is of no known format, or this machine cannot encode it.
    """
    check_output(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.part{path.suffix}")
    with contextlib.ExitStack() as stack:
        stack.callback(unfinished.unlink, missing_ok=True)
        painters = stack.enter_context(open_painters(recording, backend))
        if path.suffix == ".png":
            draw_strip(recording, painters, num_pictures).save(unfinished, optimize=True)
        else:
            steps = frame_steps(recording)
            frames = (draw_frame(painters, step) for step in steps)
            if path.suffix == ".mp4":
                write_mp4(unfinished, frames)
            else:
                write_gif(unfinished, frames, tile([draw_frame(painters, step) for step in (steps[0], steps[-1])], 1))
        unfinished.rename(path)


def frame_steps(recording: Recording) -> list[int]:
    """The control step that each frame of a video shows."""
    stride = max(1, round(1.0 / (FRAME_RATE * recording.ctrl_dt)))
    last = int(recording.length.max())
    return [*range(0, last, stride), *[last] * round(_LAST_FRAME_SECONDS * FRAME_RATE)]


class Painter:
    """Draws one robot of a recording.

    Attributes:
        camera: where it is seen from; follows a hopper.
        bodies: [L + 1, nbody, 3] m, where the robot's bodies are at each control step of its episode, the goal's among them.
    """

    def __init__(self, recording: Recording, row: int, size: tuple[int, int], renderer: type):
        """Args:
        recording: what to draw.
        row: which robot of it.
        size: width and height in pixels.
        renderer: `mujoco.Renderer`, see `graphics.renderer_class`.
        """
        self._recording, self._row, self._length = recording, row, int(recording.length[row])
        self._model = make_drawing(recording.pool, row)
        self._data = mujoco.MjData(self._model)
        self.camera = mujoco.MjvCamera()
        self.camera.azimuth, self.camera.elevation = _HOPPER_VIEW if self._is_hopper else _ARM_VIEW
        self.bodies = np.stack([self._pose(step) for step in range(self._length + 1)])
        self._path = np.zeros((0, 3)) if self._is_hopper else self.bodies[:, self._model.body("tool").id - 1]
        self._renderer = renderer(self._model, size[1], size[0])

    @property
    def _is_hopper(self) -> bool:
        return self._recording.goal is None

    def draw(self, step: int) -> Image.Image:
        """The robot at a control step, or at the end of its episode if that was before."""
        recording, is_over, step = self._recording, step >= self._length, min(step, self._length)
        self._pose(step)
        if self._is_hopper:
            self.camera.lookat[0] = self._data.qpos[0]
        self._renderer.update_scene(self._data, self.camera)
        add_trail(self._renderer.scene, self._path[: step + 1])
        image = Image.fromarray(self._renderer.render())
        caption = recording.outcomes[self._row] if is_over else f"{step * recording.ctrl_dt:.1f} s"
        colour = _SUCCESS_COLOUR if is_over and recording.success[self._row] else _CAPTION_COLOUR
        font = ImageFont.load_default(size=max(12, image.height // 18))
        ImageDraw.Draw(image).text((8, 5), f"{recording.names[self._row]}   {caption}", fill=colour, font=font)
        return image

    def close(self) -> None:
        self._renderer.close()

    def _pose(self, step: int) -> np.ndarray:
        """Puts the robot where it is at a control step of its episode, and the goal: its bodies' positions [nbody - 1, 3] m."""
        self._data.qpos[:] = self._recording.qpos[step, self._row]
        if self._recording.goal is not None:
            is_reached = bool(self._recording.success[self._row]) and step == self._length
            put_goal(self._model, self._data, self._recording.goal[self._row], is_reached)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        return self._data.xpos[1:].copy()


@contextlib.contextmanager
def open_painters(recording: Recording, backend: str) -> Iterator[list[Painter]]:
    """A painter for each robot, all with the same view."""
    renderer = renderer_class(backend)
    count = recording.pool.num_robots
    with contextlib.ExitStack() as stack:
        painters = []
        for row in range(count):
            painters.append(Painter(recording, row, _LARGE if count == 1 else _SMALL, renderer))
            stack.callback(painters[row].close)
        frame_all(painters, recording.goal is None)
        yield painters


def frame_all(painters: list[Painter], is_hopper: bool) -> None:
    """Sets the painters' cameras so that all bodies are in each picture during the whole episode; hoppers' move along."""
    points = np.concatenate([painter.bodies.reshape(-1, 3) for painter in painters])
    if is_hopper:
        height = points[:, 2].max()
        points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, _HOPPER_ROOM * height]])
    centre, distance = fit_camera(points, *(_HOPPER_VIEW if is_hopper else _ARM_VIEW))
    for painter in painters:
        painter.camera.lookat, painter.camera.distance = centre, distance


def fit_camera(points: np.ndarray, azimuth: float, elevation: float) -> tuple[np.ndarray, float]:
    """What a camera that looks along azimuth and elevation [degrees] has to look at [3] m, and from how far away [m], to have
    `points` [P, 3] m in a picture of 4 to 3 with some margin."""
    turn, rise = math.radians(azimuth), math.radians(elevation)
    forward = np.array([math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn), math.sin(rise)])
    right = np.array([math.sin(turn), -math.cos(turn), 0.0])
    axes = np.stack([right, np.cross(right, forward), forward])
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    across, up, depth = (seen - middle).T
    slope = math.tan(math.radians(_FIELD_OF_VIEW / 2)) / _MARGIN
    distance = np.max(np.maximum(np.abs(up) / slope, np.abs(across) / (slope * _ASPECT)) - depth)
    return middle @ axes, float(distance)


def add_trail(scene: mujoco.MjvScene, path: np.ndarray) -> None:
    """Adds a line through the points `path` [P, 3] m to a scene."""
    for start, end in itertools.pairwise(path):
        if scene.ngeom == scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
        mujoco.mjv_initGeom(geom, capsule, np.zeros(3), np.zeros(3), np.zeros(9), _TRAIL_COLOUR)
        mujoco.mjv_connector(geom, capsule, _TRAIL_RADIUS, start, end)
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR  # without a shadow
        scene.ngeom += 1


def draw_frame(painters: list[Painter], step: int) -> Image.Image:
    """All robots at a control step, in a grid."""
    return tile([painter.draw(step) for painter in painters], math.ceil(math.sqrt(len(painters))))


def draw_strip(recording: Recording, painters: list[Painter], num_pictures: int) -> Image.Image:
    """`num_pictures` of each robot from its start to its end, a row each; if that is 1, the ends in a grid."""
    if num_pictures == 1:
        return draw_frame(painters, int(recording.length.max()))
    pictures = [
        painter.draw(round(step))
        for painter, length in zip(painters, recording.length, strict=True)
        for step in np.linspace(0, length, num_pictures)
    ]
    return tile(pictures, num_pictures)


def tile(pictures: list[Image.Image], columns: int) -> Image.Image:
    """Pictures of one size side by side, row after row."""
    width, height = pictures[0].size
    columns = min(columns, len(pictures))
    whole = Image.new("RGB", (columns * width, -(-len(pictures) // columns) * height), "white")
    for i, picture in enumerate(pictures):
        whole.paste(picture, (i % columns * width, i // columns * height))
    return whole


def write_mp4(path: pathlib.Path, frames: Iterator[Image.Image]) -> None:
    """H.264, by the ffmpeg that imageio-ffmpeg brings. (Its own writer forks, which JAX warns about.)"""
    from imageio_ffmpeg import get_ffmpeg_exe

    first = next(frames)
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{first.width}x{first.height}", "-r", str(FRAME_RATE), "-i", "-"]
    target = ["-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path)]
    command = [get_ffmpeg_exe(), "-loglevel", "error", *source, *target]
    with tempfile.TemporaryFile() as log:
        encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log)
        try:
            assert encoder.stdin is not None
            with contextlib.suppress(BrokenPipeError), encoder.stdin as pipe:
                for frame in itertools.chain([first], frames):
                    pipe.write(frame.tobytes())
        finally:
            encoder.wait()
        if encoder.returncode:
            log.seek(0)
            raise GraphicsError(f"--out={path}: ffmpeg ended with {log.read().decode(errors='replace').strip()}")


def write_gif(path: pathlib.Path, frames: Iterator[Image.Image], colours: Image.Image) -> None:
    """All frames have the 256 colours of one picture, so that what stands still is stored once."""
    palette = colours.quantize(256, method=Image.Quantize.FASTOCTREE)
    first, *rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    first.save(path, save_all=True, append_images=rest, duration=1000 // FRAME_RATE, loop=0)

"""A live arm in the browser (viser): its type, its links and its goal are dragged, and the policy reacts."""

import math
import pathlib
import socket
import time

import mujoco
import numpy as np
import trimesh

from hcp_jax.config import ArmConfig, ArmPoolConfig, ConfigError
from hcp_jax.envs.arm import CTRL_DT
from hcp_jax.errors import one_line
from hcp_jax.experiment.arm import ArmExperiment
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.chosen_robots import heldout_kinds
from hcp_jax.hardware.arm import LINKS, TYPES
from hcp_jax.rendering.drawing import ARM_FLOOR, GOAL_GEOMS, OPEN_GOAL, REACHED_GOAL, make_drawing, put_goal
from hcp_jax.rendering.graphics import GraphicsError
from hcp_jax.rendering.live import LiveArm
from hcp_jax.training import run_folder
from hcp_jax.training.policy_file import load_policy

SETTLE_SECONDS = 0.3  # since the last change of a slider, before the arm is built anew
_SLIDER_STEP = 0.005  # [m]
_TICKS_PER_PICTURE = 2
_CAMERA = ((0.95, -1.3, 0.7), (0.4, 0.0, 0.1))  # [m] where it stands and what it looks at
_PLANE = mujoco.mjtGeom.mjGEOM_PLANE


def open_view(folder: pathlib.Path, host: str, port: int, best: bool = False) -> "ArmView":
    """Starts the server for the policy of an arm run.

    Raises:
        GraphicsError: viser is not installed.
        RunFolderError, CheckpointError, ConfigError: the folder holds no policy of arms.
    """
    try:
        import viser
    except ImportError as error:
        raise GraphicsError("the view needs the extra viz: pip install viser") from error
    config = run_folder.read_config(folder)
    if config.task == "hopper":
        raise ConfigError(f"{folder}: a policy of hoppers; the view shows arms (hcp_jax.render films hoppers)")
    check_host(host)
    run = make_experiment(config)
    assert isinstance(run, ArmExperiment)
    params = run.learner.policy(load_policy(folder, run, best)[1])
    return ArmView(viser.ViserServer(host=host, port=port, label=config.name, verbose=False), run, params)


def check_host(host: str) -> None:
    """Raises ConfigError unless a server can listen at `host`; viser would wait for ever."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.create_server((host, 0), family=family).close()
    except OSError as error:
        raise ConfigError(f"--host={host}: expected an address of this machine ({one_line(error)})") from error


class ArmView:
    """Server, controls and the arm. Callbacks of the controls note what was asked for; `tick` does it.

    Attributes:
        arm: what moves.
        robot_type, lengths, new_pose: the controls; lengths are by name of the link, changes from nominal in m.
        gizmo: what the goal is dragged by.
        shapes: handles of what is seen, by the drawing's number of each geom.
    """

    def __init__(self, server, run: ArmExperiment, params):
        """Args:
        server: a `viser.ViserServer`.
        run: the experiment that the policy comes from.
        params: the policy's.
        """
        assert isinstance(run.config.pool, ArmPoolConfig)
        assert isinstance(run.config.env, ArmConfig)
        self.server, self.arm = server, LiveArm(run, params)
        self._within = run.config.env.success_distance
        self._rebuild_at, self._asks_pose, self._asked_goal = math.inf, False, None
        self.shapes, self._num_ticks = {}, 0
        self._add_controls([kind for kind in heldout_kinds(run.config) if kind in TYPES], run.config.pool)
        self._rebuild()
        self.gizmo = server.scene.add_transform_controls(
            "/goal", scale=0.15, disable_rotations=True, disable_sliders=True, position=self.arm.goal
        )
        self.gizmo.on_update(lambda _: self.ask_goal(np.asarray(self.gizmo.position)))
        server.scene.set_up_direction("+z")
        server.scene.add_grid("/floor", 4.0, 4.0, position=(0.0, 0.0, ARM_FLOOR), cell_size=0.25, plane_opacity=0.4)
        server.initial_camera.position, server.initial_camera.look_at = _CAMERA

    def run(self) -> None:
        """Moves the arm in real time until the process is interrupted."""
        due = time.monotonic()
        while True:
            self.tick()
            due = max(due + CTRL_DT, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))

    def tick(self) -> None:
        """One control step, and what was asked for since the last."""
        if time.monotonic() >= self._rebuild_at:
            self._rebuild_at = math.inf
            self._rebuild()
        if self._asks_pose:
            self._asks_pose = False
            self.arm.restart()
        if self._asked_goal is not None:
            goal, self._asked_goal = self._asked_goal, None
            self.arm.set_goal(goal)
        self.arm.step()
        self._num_ticks += 1
        if self._num_ticks % _TICKS_PER_PICTURE == 0:
            self._show()

    def ask_goal(self, goal: np.ndarray) -> None:
        """Moves the goal to `goal` [3] m with the next tick."""
        self._asked_goal = goal

    def _add_controls(self, types: list[str], pool_config: ArmPoolConfig) -> None:
        gui = self.server.gui
        self.robot_type = gui.add_dropdown("arm type", types)
        self.robot_type.on_update(lambda _: self._ask_robot(0.0))
        with gui.add_folder("link lengths, change from nominal [m]"):
            self.lengths = {}
            for link in LINKS:
                low, high = getattr(pool_config.ranges, link)
                if low < high:
                    middle = float(np.clip(0.0, low, high))
                    self.lengths[link] = gui.add_slider(link, low, high, _SLIDER_STEP, middle)
                    self.lengths[link].on_update(lambda _: self._ask_robot(SETTLE_SECONDS))
        self.new_pose = gui.add_button("new start pose")
        self.new_pose.on_click(lambda _: self._ask_pose())
        self.status = gui.add_markdown("")

    def _ask_robot(self, seconds: float) -> None:
        self._rebuild_at = time.monotonic() + seconds

    def _ask_pose(self) -> None:
        self._asks_pose = True

    def _rebuild(self) -> None:
        """Makes the arm that the controls say, and its shapes."""
        self.status.content = "compiling the policy for this arm ..."
        lengths = [self.lengths[link].value if link in self.lengths else 0.0 for link in LINKS]
        self.arm.set_robot(self.robot_type.value, np.asarray(lengths))
        for shape in self.shapes.values():
            shape.remove()
        self._model = make_drawing(self.arm.pool, 0)
        self._data = mujoco.MjData(self._model)
        self.shapes = {i: self._add_shape(i) for i in range(self._model.ngeom) if self._model.geom_type[i] != _PLANE}
        self._show()

    def _add_shape(self, index: int):
        """The scene's handle of a geom."""
        mesh = make_mesh(self._model.geom_type[index], self._model.geom_size[index])
        *colour, opacity = (float(value) for value in self._model.geom_rgba[index])
        return self.server.scene.add_mesh_simple(
            f"/shapes/{index}",
            np.asarray(mesh.vertices),
            np.asarray(mesh.faces),
            color=tuple(colour),
            opacity=None if opacity == 1.0 else opacity,
        )

    def _show(self) -> None:
        """Puts the shapes where the arm is."""
        is_reached = self.arm.distance < self._within
        self._data.qpos[:] = self.arm.qpos
        put_goal(self._model, self._data, self.arm.goal, is_reached)
        mujoco.mj_kinematics(self._model, self._data)
        quat = np.zeros(4)
        with self.server.atomic():
            for index, shape in self.shapes.items():
                mujoco.mju_mat2Quat(quat, self._data.geom_xmat[index])
                shape.position, shape.wxyz = self._data.geom_xpos[index], quat
            for name in GOAL_GEOMS:
                self.shapes[self._model.geom(name).id].color = REACHED_GOAL if is_reached else OPEN_GOAL
            self.status.content = f"{100 * self.arm.distance:.1f} cm from the goal{', reached' if is_reached else ''}"


def make_mesh(kind: int, size: np.ndarray) -> trimesh.Trimesh:
    """A geom's surface in its own frame: sphere, capsule, cylinder or box of MuJoCo's `size` [3] m."""
    radius, half = float(size[0]), float(size[1])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return trimesh.creation.icosphere(subdivisions=2, radius=radius)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        capsule = trimesh.creation.capsule(height=2 * half, radius=radius)
        return capsule.apply_translation(-capsule.bounds.mean(axis=0))
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return trimesh.creation.cylinder(radius=radius, height=2 * half)
    assert kind == mujoco.mjtGeom.mjGEOM_BOX
    return trimesh.creation.box(extents=2 * size)

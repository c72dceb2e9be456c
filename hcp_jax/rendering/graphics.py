"""OpenGL on machines without a display: which of MuJoCo's ways to it works here."""

import importlib
import os
import subprocess
import sys

from hcp_jax.errors import UserError

BACKENDS = ("egl", "osmesa", "glfw")  # in the order in which they are tried; the last needs a display
DEBIAN_PACKAGES = "libegl1 libgl1"  # for EGL; what they depend on draws in software. OSMesa: libosmesa6
_PROBE = (
    "import mujoco\nwith mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8) as renderer:\n    renderer.render()"
)
_MAX_SECONDS = 60.0


class GraphicsError(UserError):
    """Nothing can be drawn on this machine, or not into the file asked for."""


def choose_backend() -> str:
    """The first of `BACKENDS` that draws a picture here, or what the environment variable MUJOCO_GL names if that does.

    Each is tried in a process of its own: a library that fails to load leaves PyOpenGL unusable.

    Raises:
        GraphicsError: none of them does, or MUJOCO_GL names none of them.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked and asked not in BACKENDS:
        raise GraphicsError(f"MUJOCO_GL={asked}: expected one of {', '.join(BACKENDS)}, or nothing")
    for name in (asked,) if asked else BACKENDS:
        environment = os.environ | {"MUJOCO_GL": name}
        command = [sys.executable, "-c", _PROBE]
        try:
            if subprocess.run(command, env=environment, capture_output=True, timeout=_MAX_SECONDS, check=False).returncode == 0:
                return name
        except subprocess.TimeoutExpired:
            continue
    failed = f"MUJOCO_GL={asked} does not draw here" if asked else "no OpenGL draws here"
    raise GraphicsError(f"{failed}: expected EGL or OSMesa; on Debian: apt-get install {DEBIAN_PACKAGES}")


def renderer_class(backend: str) -> type:
    """`mujoco.Renderer`, drawing with `backend` from here on, whatever was chosen when mujoco was imported first."""
    os.environ["MUJOCO_GL"] = backend
    classic = "mujoco.rendering.classic"
    gl_context, renderer = (importlib.import_module(f"{classic}.{name}") for name in ("gl_context", "renderer"))
    gl_context.GLContext = importlib.import_module(f"mujoco.{backend}").GLContext
    return renderer.Renderer

"""A MuJoCo model of each robot to draw: its kinematics, and shapes, floor and light that the physics has no use for.

An arm is drawn from its chain alone, so that those of our types, of a saved pool and of somebody's file look alike: capsules
between joints, a cylinder around each joint's axis. Slots of missing joints have no shape. The peg, its gripper and the table
are those that the physics collides.
"""

import mujoco
import numpy as np

from hcp_jax.envs.arm import TARGET_ABOVE_TABLE
from hcp_jax.hardware import hopper
from hcp_jax.hardware.chain import place_bodies
from hcp_jax.hardware.pool import RobotPool

GOAL_BODY, GOAL_GEOMS = "goal", ("goal", "goal_halo")
OPEN_GOAL, REACHED_GOAL = (0.95, 0.5, 0.1), (0.15, 0.7, 0.2)
_LINK_COLOUR, _JOINT_COLOUR, _TIP_COLOUR = (0.82, 0.84, 0.87, 1.0), (0.2, 0.3, 0.42, 1.0), (0.8, 0.2, 0.15, 1.0)
_STAND_COLOUR, _TABLE_COLOUR = (0.4, 0.42, 0.45, 1.0), (0.72, 0.6, 0.45, 0.35)
ARM_FLOOR = -0.6  # [m] below the arm's base, which stands on a column
# [m] Radii of the first link and of the last per m of the arm's length.
_FIRST_RADIUS, _LAST_RADIUS = 0.04, 0.022
_TABLE_FOOT = (0.4, 0.4, 0.2)  # [m] half sizes of what is drawn below the table
_GOAL_RADII = (0.02, 0.05)  # [m] the region of success, and a halo that is seen from afar
_MIN_LENGTH = 1e-3  # [m] of a link that is drawn


def make_drawing(pool: RobotPool, row: int) -> mujoco.MjModel:
    """The robot at position `row` of a pool, for pictures: its qpos is the physics' own.

    Arms also have a mocap body `goal`; it comes after the table, where there is one.
    """
    spec = mujoco.MjSpec.from_string(pool.template)
    if "link_length" in pool.hardware:
        hopper.edit_spec(spec, {name: values[row] for name, values in pool.hardware.items()})
        spec.delete(spec.geom("floor"))
        spec.delete(spec.light("sun"))
        add_surroundings(spec, 0.0, spec.body("torso"))
    else:
        count = int(pool.hardware["joint_mask"][row].sum())
        pos, quat = (pool.hardware[f"chain_{name}"][row, : count + 1] for name in ("pos", "quat"))
        place_bodies(spec, pos, quat)
        add_links(spec, pos, quat)
        add_goal(spec)
        add_surroundings(spec, ARM_FLOOR, spec.worldbody)
    return spec.compile()


def add_links(spec: mujoco.MjSpec, pos: np.ndarray, quat: np.ndarray) -> None:
    """Shapes of an arm of n joints: pos [n + 1, 3] m and quat [n + 1, 4] as of `place_bodies`."""
    count, length = len(pos) - 1, np.linalg.norm(pos, axis=1).sum()
    radii = length * np.linspace(_FIRST_RADIUS, _LAST_RADIUS, count + 1)
    end = pos[-1]
    if spec.geom("gripper"):
        end = gripper_end(spec, pos[-1], quat[-1])
        spec.body("table").add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=_TABLE_FOOT, pos=[0, 0, -0.25 - _TABLE_FOOT[2]])
        for geom in spec.body("table").geoms:
            geom.rgba = _TABLE_COLOUR
    else:
        spec.body("tool").add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1.2 * radii[-1], 0, 0], rgba=_TIP_COLOUR)
    bodies = [spec.worldbody, *(spec.body(f"slot{i}") for i in range(count))]
    for body, radius, target in zip(bodies, radii, [*pos[:-1], end], strict=True):
        if np.linalg.norm(target) > _MIN_LENGTH:
            add_capsule(body, np.zeros(3), target, radius, _LINK_COLOUR)
    for body, radius in zip(bodies[1:], radii[1:], strict=True):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[1.15 * radius, 1.3 * radius, 0], rgba=_JOINT_COLOUR)
    add_capsule(spec.worldbody, np.array([0.0, 0.0, ARM_FLOOR]), np.zeros(3), 1.5 * radii[0], _STAND_COLOUR)


def gripper_end(spec: mujoco.MjSpec, pos: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """The end of a template's gripper that is nearer to the last joint, in that joint's frame: [3] m.

    Args:
        pos, quat: the tool's frame in the joint's.
    """
    ends = []
    for point in np.array(spec.geom("gripper").fromto).reshape(2, 3):
        turned = np.zeros(3)
        mujoco.mju_rotVecQuat(turned, point, quat)
        ends.append(pos + turned)
    return min(ends, key=np.linalg.norm)


def add_capsule(body: mujoco.MjsBody, start: np.ndarray, end: np.ndarray, radius: float, colour: tuple) -> None:
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[radius, 0, 0], rgba=colour)


def add_goal(spec: mujoco.MjSpec) -> None:
    """A body that can be put where the goal is."""
    goal = spec.worldbody.add_body(name=GOAL_BODY, mocap=True)
    for name, radius, alpha in zip(GOAL_GEOMS, _GOAL_RADII, (1.0, 0.35), strict=True):
        goal.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], rgba=[*OPEN_GOAL, alpha])


def add_surroundings(spec: mujoco.MjSpec, floor: float, lit: mujoco.MjsBody) -> None:
    """A tiled floor at height `floor` [m] that never ends, sky, and a sun that goes with the body `lit`."""
    texture, role = mujoco.mjtTexture, mujoco.mjtTextureRole.mjTEXROLE_RGB
    spec.add_texture(
        name="sky", type=texture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.98], rgb2=[0.75, 0.82, 0.9], width=64, height=384,
    )  # fmt: skip
    spec.add_texture(
        name="tiles", type=texture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.62, 0.66, 0.7], rgb2=[0.56, 0.6, 0.64], width=256, height=256,
    )  # fmt: skip
    tiles = spec.add_material(name="tiles", texrepeat=[1, 1], texuniform=True)
    tiles.textures[role] = "tiles"
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], pos=[0, 0, floor], material="tiles", rgba=[1, 1, 1, 1]
    )
    lit.add_light(
        name="sunlight", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK, type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[1, -2, 4], dir=[-0.2, 0.45, -1], diffuse=[0.6, 0.6, 0.6], castshadow=True,
    )  # fmt: skip
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    spec.visual.quality.shadowsize = 2048


def put_goal(model: mujoco.MjModel, data: mujoco.MjData, goal: np.ndarray, reached: bool) -> None:
    """Moves an arm's goal to `goal` [3] m, and the table with it, and shows whether it was reached."""
    data.mocap_pos[model.body(GOAL_BODY).mocapid[0]] = goal
    table = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "table")
    if table >= 0:
        data.mocap_pos[model.body_mocapid[table]] = goal - np.array([0.0, 0.0, TARGET_ABOVE_TABLE])
    for name in GOAL_GEOMS:
        model.geom(name).rgba[:3] = REACHED_GOAL if reached else OPEN_GOAL

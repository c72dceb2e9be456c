"""Sketches of the robots, from their kinematics."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d import Axes3D

from hcp_jax.hardware.arm import OTHER_ARMS, REMOVED_JOINTS, arm_spec
from hcp_jax.hardware.chain import MAX_JOINTS, read_chain
from hcp_jax.hardware.hopper import JOINTS, LINKS, TEMPLATE
from hcp_jax.hardware.kinematics import joint_poses, quat_to_matrix
from hcp_jax.hardware.pool import robots_path
from hcp_jax.hardware.start_poses import start_angles
from hcp_jax.reporting.plots import render

_START = 37  # of the reacher's start poses: one in the middle of their box
_AXIS_LENGTH = 0.1  # [m] of the lines that show how joints turn
_SIZE = (2.6, 2.6)  # [inch]
_ROOM = {"x": (0.0, 0.8), "y": (-0.2, 0.4), "z": (0.0, 0.85)}  # [m] that the sketches show


def arm_pose(robot_type: str) -> tuple[np.ndarray, np.ndarray]:
    """The nominal arm of a type in one of the reacher's start poses, its missing joints at 0.

    Returns:
        positions [n + 1, 3] m of its n joints and of the peg's tip, and the joints' axes [n, 3].
    """
    chain = read_chain(arm_spec("peg_insertion", robot_type).compile())
    rotation = quat_to_matrix(jnp.asarray(chain.padded("quat"), jnp.float32))
    angles = start_angles("reacher", robot_type)[_START]
    positions, rotations = jax.device_get(joint_poses(jnp.asarray(chain.padded("pos")), rotation, angles))
    joints = chain.num_joints
    return positions[: joints + 1], rotations[:joints, :, 2]


def draw_arm(robot_type: str) -> str:
    """A ring at each joint, a line along its axis, a dot at the peg's tip; metres."""
    positions, axes_of_joints = arm_pose(robot_type)

    def draw(axes: Axes) -> None:
        assert isinstance(axes, Axes3D)
        path = np.concatenate([[[0.0, 0.0, 0.0]], positions])
        axes.plot(*path.T, color="#555555", linewidth=4, solid_capstyle="round", alpha=0.7)
        for position, axis in zip(positions, axes_of_joints, strict=False):
            ends = np.stack([position - _AXIS_LENGTH * axis, position + _AXIS_LENGTH * axis])
            axes.plot(*ends.T, color="#D55E00", linewidth=1.2)
        axes.plot(*positions[:-1].T, "o", markersize=6.5, markerfacecolor="white", markeredgecolor="black")
        axes.plot(*positions[-1:].T, "o", markersize=5, color="#0072B2")
        axes.set(
            **{f"{name}lim": limits for name, limits in _ROOM.items()},
            xticks=(0, 0.4, 0.8),
            yticks=(0, 0.4),
            zticks=(0, 0.4, 0.8),
        )
        axes.set_box_aspect([high - low for low, high in _ROOM.values()])
        axes.set_proj_type("ortho")
        axes.view_init(elev=20, azim=-60)
        axes.tick_params(pad=-2, labelsize=7)
        axes.set_xlabel("x [m]", labelpad=-6)
        axes.set_ylabel("y [m]", labelpad=-6)
        axes.text2D(0.8, 0.97, "z [m]", transform=axes.transAxes)  # a label at its side would be cut off

    return render(draw, _SIZE, "3d")


def describe_arm(robot_type: str) -> str:
    """`A: 5 joints, without j2, j4`."""
    removed = REMOVED_JOINTS[robot_type]
    joints = MAX_JOINTS - len(removed)
    template = {"J": "another arm, without sideways offsets; ", "K": "Fetch; "}.get(robot_type, "")
    without = f", without {', '.join(removed)}" if removed and robot_type not in OTHER_ARMS else ""
    return f"{robot_type}: {template}{joints} joints{without}"


def draw_hopper() -> str:
    """The nominal hopper from the side: its links as they are, a ring at each joint; metres."""
    model = mujoco.MjModel.from_xml_path(str(robots_path() / TEMPLATE))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)

    def draw(axes: Axes) -> None:
        for link in LINKS:
            geom = model.geom(link).id
            radius, half = model.geom_size[geom, :2]
            along = data.geom_xmat[geom].reshape(3, 3)[[0, 2], 2]
            axes.fill(*capsule(data.geom_xpos[geom, [0, 2]], along, radius, half).T, color="#999999")
        anchors = data.xanchor[[model.joint(name).id for name in JOINTS]]
        axes.plot(anchors[:, 0], anchors[:, 2], "o", markersize=6, markerfacecolor="white", markeredgecolor="black")
        axes.set(xlim=(-0.7, 0.7), ylim=(0.0, 1.6), xlabel="x [m]", ylabel="z [m]", aspect="equal")

    return render(draw, _SIZE)


def capsule(centre: np.ndarray, along: np.ndarray, radius: float, half: float) -> np.ndarray:
    """The outline [K, 2] of a capsule of `half` its length in the direction `along` [2]."""
    across = np.array([-along[1], along[0]])
    turn = np.linspace(0.0, np.pi, 20)[:, None]
    cap = radius * (np.cos(turn) * across + np.sin(turn) * along)
    return np.concatenate([centre + half * along + cap, centre - half * along - cap])

"""The catalogue's arms against forward kinematics that were published apart from their descriptions, and published weights."""

import dataclasses
import functools
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.hardware.catalogue import catalogue_names, find_robot
from hcp_jax.hardware.chain import Chain
from hcp_jax.hardware.kinematics import joint_poses, quat_to_matrix
from hcp_jax.hardware.robot_file import RobotFile, RobotFileError, read_robot_here

HALF = np.pi / 2
MILLIMETRE = 1e-3


def rotation(axis: str, angle: float) -> np.ndarray:
    """4 x 4."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    result = np.eye(4)
    result[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return result


def translation(x: float, y: float, z: float) -> np.ndarray:
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def standard(rows, base=np.eye(4)) -> Callable[[np.ndarray], np.ndarray]:  # noqa: B008
    """Pose by angles, of Denavit and Hartenberg's rows (a, alpha, d, theta at angle 0)."""

    def pose(angles):
        result = base
        for (a, alpha, d, offset), angle in zip(rows, angles, strict=True):
            result = result @ rotation("z", angle + offset) @ translation(a, 0, d) @ rotation("x", alpha)
        return result

    return pose


def modified(rows, flange: float = 0.0) -> Callable[[np.ndarray], np.ndarray]:
    """The same of Craig's rows (a and alpha of the link before), with the flange `flange` [m] along the last axis."""

    def pose(angles):
        result = np.eye(4)
        for (a, alpha, d, offset), angle in zip(rows, angles, strict=True):
            result = result @ rotation("x", alpha) @ translation(a, 0, d) @ rotation("z", angle + offset)
        return result @ translation(0, 0, flange)

    return pose


def fetch(angles) -> np.ndarray:
    offsets = [(0.1195, 0, 0.3486), (0.117, 0, 0.06), *((x, 0, 0) for x in (0.219, 0.133, 0.197, 0.1245, 0.1385))]
    result = np.eye(4)
    for offset, axis, angle in zip(offsets, "zyxyxyx", angles, strict=True):
        result = result @ translation(*offset) @ rotation(axis, angle)
    return result @ translation(0.1664, 0, 0)


@dataclasses.dataclass(frozen=True)
class Published:
    """What was published of an arm: forward kinematics with how far they go [m], weight [kg] and how near ours must be."""

    pose: Callable[[np.ndarray], np.ndarray]
    tolerance: float
    weight: float
    weight_tolerance: float


PUBLISHED = {
    # Lengths: D. Layeghi, "Dynamic and Kinematic Modelling of the Sawyer Arm", 2017, as in Robotics Toolbox for Python
    # (DH/Sawyer.py); signs and offsets: the standard table of the public identification code robot_dyn. Its flange is 0.75 mm
    # nearer, and the description turns it by 10 degrees. Weight: Rethink's data sheet.
    "sawyer": Published(
        standard(
            [
                (-0.081, HALF, 0.317, np.pi), (0, HALF, 0.1925, -HALF), (0, HALF, 0.4, np.pi), (0, HALF, -0.1685, np.pi),
                (0, HALF, 0.4, np.pi), (0, HALF, 0.1363, np.pi), (0, 0, 0.13375, -HALF - 0.17453),
            ]
        ),
        MILLIMETRE, 19.0, 0.10,
    ),
    # Franka Control Interface documentation, "Denavit-Hartenberg parameters" (Craig's convention); weight: its data sheet.
    "panda": Published(
        modified(
            [
                (0, 0, 0.333, 0), (0, -HALF, 0, 0), (0, HALF, 0.316, 0), (0.0825, HALF, 0, 0),
                (-0.0825, -HALF, 0.384, 0), (0, HALF, 0, 0), (0.088, HALF, 0, 0),
            ],
            flange=0.107,
        ),
        1e-6, 17.8, 0.10,
    ),
    # C. Faria et al., "Position-based kinematics for 7-DoF serial manipulators", Mechanism and Machine Theory 121, 2018, with
    # the lengths of KUKA's data sheet of the LBR iiwa 14 R820 (360, 420, 400, 126 mm), which states the weight too.
    "iiwa14": Published(
        standard(
            [
                (0, -HALF, 0.36, 0), (0, HALF, 0, 0), (0, HALF, 0.42, 0), (0, -HALF, 0, 0),
                (0, -HALF, 0.4, 0), (0, HALF, 0, 0), (0, 0, 0.126, 0),
            ]
        ),
        1e-6, 29.9, 0.05,
    ),
    # Universal Robots, "DH Parameters for calculations of kinematics and dynamics"; base_link is turned by pi (ROS, REP 199).
    # Weights: the technical specifications of e-Series; the weight of the base is not published and a guess of the description.
    "ur5e": Published(
        standard(
            [
                (0, HALF, 0.1625, 0), (-0.425, 0, 0, 0), (-0.3922, 0, 0, 0),
                (0, HALF, 0.1333, 0), (0, -HALF, 0.0997, 0), (0, 0, 0.0996, 0),
            ],
            rotation("z", np.pi),
        ),
        1e-6, 20.6, 0.10,
    ),
    "ur10e": Published(
        standard(
            [
                (0, HALF, 0.1807, 0), (-0.6127, 0, 0, 0), (-0.57155, 0, 0, 0),
                (0, HALF, 0.17415, 0), (0, -HALF, 0.11985, 0), (0, 0, 0.11655, 0),
            ],
            rotation("z", np.pi),
        ),
        1e-6, 33.5, 0.10,
    ),
    # Kinova, "Gen3 Ultra lightweight robot, user guide", classical DH parameters of the 7-DOF arm, in 0.1 mm; weight: the same.
    "gen3": Published(
        standard(
            [
                (0, HALF, -(0.1564 + 0.1284), 0), (0, HALF, -(0.0054 + 0.0064), np.pi), (0, HALF, -(0.2104 + 0.2104), np.pi),
                (0, HALF, -(0.0064 + 0.0064), np.pi), (0, HALF, -(0.2084 + 0.1059), np.pi), (0, HALF, 0, np.pi),
                (0, np.pi, -(0.1059 + 0.0615), np.pi),
            ],
            rotation("x", np.pi),
        ),
        0.5 * MILLIMETRE, 8.2, 0.02,
    ),
    # UFACTORY, "Kinematic and dynamic parameters of UFACTORY xArm series", modified D-H; weight: user manual. The description
    # has 11.3 kg: its base weighs 0.9 kg.
    "xarm7": Published(
        modified(
            [
                (0, 0, 0.267, 0), (0, -HALF, 0, 0), (0, HALF, 0.293, 0), (0.0525, HALF, 0, 0),
                (0.0775, HALF, 0.3425, 0), (0, HALF, 0, 0), (0.076, -HALF, 0.097, 0),
            ]
        ),
        0.02 * MILLIMETRE, 13.7, 0.20,
    ),
    # No DH parameters and no weight of the arm alone were published: the Fetch model of OpenAI in gymnasium-robotics 1.4.2
    # (envs/assets/fetch/robot.xml), body offsets in 0.1 mm and masses, without its fingers of 4 kg each.
    "fetch": Published(fetch, 0.3 * MILLIMETRE, 2.5587 + 2.6615 + 2.3311 + 2.1299 + 1.6563 + 1.725 + 0.1354 + 1.5175, 0.02),
}  # fmt: skip


@functools.cache
def read(name: str) -> RobotFile:
    return read_robot_here(find_robot(name), None, None)


def chain_poses(chain: Chain, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position [B, 3] and rotation [B, 3, 3] of the tip at angles [B, n], as policies see it."""
    padded = np.zeros((len(angles), 7))
    padded[:, : chain.num_joints] = angles
    turns = quat_to_matrix(jnp.asarray(chain.padded("quat")))
    positions, rotations = joint_poses(jnp.asarray(chain.padded("pos")), turns, jnp.asarray(padded))
    return np.asarray(positions[:, -1]), np.asarray(rotations[:, -1])


def test_every_arm_is_compared():
    assert catalogue_names() == tuple(sorted(PUBLISHED))


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_flange_is_where_the_published_kinematics_put_it(name, rng):
    chain, published = read(name).chain, PUBLISHED[name]
    angles = np.concatenate([np.zeros((1, chain.num_joints)), rng.uniform(-2.0, 2.0, (5, chain.num_joints))])
    positions, rotations = chain_poses(chain, angles)
    theirs = np.stack([published.pose(row) for row in angles])
    np.testing.assert_allclose(positions, theirs[:, :3, 3], atol=published.tolerance + 1e-6)  # float32
    np.testing.assert_allclose(rotations, theirs[:, :3, :3], atol=5e-5)  # pi as 3.1416 in some descriptions


@pytest.mark.parametrize("name", PUBLISHED)
def test_its_links_weigh_what_was_published(name):
    masses = {
        link.get("name"): float(link.find("inertial/mass").get("value"))
        for link in ElementTree.parse(find_robot(name)).getroot().iter("link")
        if link.find("inertial") is not None
    }
    base = {"fetch": "torso_lift_link", "ur5e": "base_link_inertia", "ur10e": "base_link_inertia"}.get(name, next(iter(masses)))
    total = sum(masses.values()) - (masses[base] if name == "fetch" else 0.0)
    assert total == pytest.approx(PUBLISHED[name].weight, rel=PUBLISHED[name].weight_tolerance)
    assert read(name).chain.mass.sum() == pytest.approx(sum(masses.values()) - masses[base], rel=1e-6)


@pytest.mark.parametrize("name", PUBLISHED)
def test_an_arm_states_its_limits_and_nothing_is_missing(name):
    robot = read(name)
    assert not [note for note in robot.notes if "torque" in note or "mesh" in note]
    assert (robot.chain.joint_range[:, 0] < robot.chain.joint_range[:, 1]).all()


def test_a_name_that_is_neither_file_nor_arm_is_answered_with_the_names():
    with pytest.raises(RobotFileError, match="sawer: no such file, and no arm of the catalogue: fetch, gen3, iiwa14, panda"):
        find_robot("sawer")

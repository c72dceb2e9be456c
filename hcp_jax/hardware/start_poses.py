"""Joint angles that arms start from, solved once on the nominal arm and the same for every variant (paper, appendix)."""

import functools
import itertools

import mujoco
import numpy as np
from scipy.optimize import least_squares

from hcp_jax.hardware.arm import JOINTS, REMOVED_JOINTS, arm_spec
from hcp_jax.hardware.chain import TIP_SITE

# [m] Grid of end-effector positions at the start of the reacher: 4 x 5 x 3 points of a box.
GRID = (np.linspace(0.3, 0.6, 4), np.linspace(-0.2, 0.2, 5), np.linspace(0.5, 0.7, 3))
REACHER_GOALS = ((0.3, -0.3, -0.1), (0.6, 0.3, 0.3))  # [m] box of its goals: low and high corner
_MAX_ERROR = 1e-3  # [m]
_REST_WEIGHT = 1e-3  # [m/rad] of angles beside the error: of all solutions the one with small angles


def start_angles(task: str, robot_type: str) -> np.ndarray:
    """Start poses of a type, angles of its joints in order, then zeros: [S, 7] rad.

    The reacher starts from one of 60 poses, its missing joints dropped; peg insertion with all joints at 0.
    """
    angles = np.zeros((1, len(JOINTS))) if task == "peg_insertion" else _reacher_angles()
    kept = [i for i, joint in enumerate(JOINTS) if joint not in REMOVED_JOINTS[robot_type]]
    result = np.zeros_like(angles)
    result[:, : len(kept)] = angles[:, kept]
    return result


@functools.cache
def _reacher_angles() -> np.ndarray:
    """Inverse kinematics of the nominal 7-DOF arm for every point of `GRID`, from all joints at 0: [60, 7] rad."""
    model = arm_spec("reacher", "I").compile()
    data, site = mujoco.MjData(model), model.site(TIP_SITE).id

    def error(angles: np.ndarray, target: np.ndarray) -> np.ndarray:
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        return np.concatenate([data.site_xpos[site] - target, _REST_WEIGHT * angles])

    def jacobian(angles: np.ndarray, target: np.ndarray) -> np.ndarray:
        error(angles, target)
        mujoco.mj_comPos(model, data)
        result = np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, result, None, site)
        return np.concatenate([result, _REST_WEIGHT * np.eye(model.nv)])

    poses = []
    for target in itertools.product(*GRID):
        solution = least_squares(
            error,
            np.zeros(model.nq),
            jac=jacobian,  # pyright: ignore[reportArgumentType]  (its stubs know names of methods alone)
            bounds=model.jnt_range.T,
            args=(np.asarray(target),),
        )
        if np.abs(solution.fun[:3]).max() > _MAX_ERROR:
            raise RuntimeError(f"no joint angles of the nominal arm reach {target}")
        poses.append(solution.x)
    return np.asarray(poses)

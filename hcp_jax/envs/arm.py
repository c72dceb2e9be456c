"""The arm's tasks: reacher and peg insertion (paper, section 5.1 and appendix; facts/FACTS.md, "Tasks").

50 Hz torque control for 200 steps, without gravity compensation. Observation: 7 joint angles and 7 joint velocities with noise,
zeros for missing joints. Action: 7 torques in units of each joint's limit. Their order is `ArmTask.joint_slots`.
"""

import dataclasses

import jax
import jax.numpy as jnp

from hcp_jax.hardware.chain import MAX_JOINTS
from hcp_jax.hardware.start_poses import REACHER_GOALS

CTRL_DT = 0.02  # [s]
NUM_SUBSTEPS = {"rk4": 20, "implicitfast": 5, "euler": 20}
HOLE = (0.6, 0.0, 0.0)  # [m] of peg insertion: the target of the peg's bottom, 0.05 m below the table top
TARGET_ABOVE_TABLE = 0.1  # [m] the target above the origin of the template's table


@dataclasses.dataclass(frozen=True)
class ArmTask:
    """Bring the point of interest to a goal.

    Attributes:
        name: `reacher` or `peg_insertion`.
        integrator: of the physics; sets the number of substeps (1 ms for rk4, 4 ms for implicitfast).
        random_hole: side of the cube [m] in which the hole's target is drawn, centred on `HOLE`; 0 keeps it there.
        approach_starts: share of episodes that start with the peg upright in the hole or above it; for training.
        episode_length: control steps.
        observation_noise: half-width of the uniform noise on angles [rad] and velocities [rad/s]; the observation's alone.
        success_distance: of the point of interest from the goal [m].
        action_cost: weight of |action|^2 in the reward (paper: beta = 0.1).
        joint_slots: layout of joints in observations and actions (`hcp_jax.hardware.joint_slots`).
    """

    name: str
    integrator: str = "implicitfast"
    random_hole: float = 0.0
    approach_starts: float = 0.0
    episode_length: int = 200
    observation_noise: float = 0.02
    success_distance: float = 0.02
    action_cost: float = 0.1
    joint_slots: str = "packed"
    observation_size: int = dataclasses.field(default=2 * MAX_JOINTS, init=False)
    action_size: int = dataclasses.field(default=MAX_JOINTS, init=False)
    goal_size: int = dataclasses.field(default=3, init=False)

    @property
    def num_substeps(self) -> int:
        return NUM_SUBSTEPS[self.integrator]

    @property
    def sim_dt(self) -> float:
        """[s]"""
        return CTRL_DT / self.num_substeps

    def sample_goal(self, key: jax.Array, num_envs: int) -> jax.Array:
        """Goals for the point of interest: [B, 3] m."""
        if self.name == "reacher":
            low, high = jnp.asarray(REACHER_GOALS)
            return jax.random.uniform(key, (num_envs, 3), minval=low, maxval=high)
        return jnp.asarray(HOLE) + self.random_hole * jax.random.uniform(key, (num_envs, 3), minval=-0.5, maxval=0.5)

    def table_position(self, goal: jax.Array) -> jax.Array | None:
        """Where the table stands [B, 1, 3] for goals [B, 3]; None without one."""
        return None if self.name == "reacher" else goal[:, None] - jnp.array([0.0, 0.0, TARGET_ABOVE_TABLE])

    def compute_reward(
        self, achieved_goal: jax.Array, desired_goal: jax.Array, action: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """+1 within the success distance, -1 elsewhere, minus the action's cost (paper, appendix, "Rewards").

        Args:
            achieved_goal, desired_goal: [..., 3] m.
            action: [..., 7] as executed, 0 for missing joints.

        Returns:
            reward [...] and success [...].
        """
        success = jnp.linalg.norm(achieved_goal - desired_goal, axis=-1) < self.success_distance
        return jnp.where(success, 1.0, -1.0) - self.action_cost * jnp.sum(jnp.square(action), axis=-1), success

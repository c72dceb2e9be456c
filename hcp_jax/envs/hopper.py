"""The hopper task (hopper.json; the reward is that of OpenAI Gym's hopper, paper appendix "Hopper")."""

import dataclasses

import jax
import jax.numpy as jnp

from hcp_jax.hardware.pool import RobotPool
from hcp_jax.physics.base import PhysicsState

SIM_DT = 0.002  # [s]
NUM_SUBSTEPS = 4
INITIAL_HEIGHT = 1.25  # [m] qpos[1] of every hopper standing, whatever its length
MIN_HEIGHT = 0.7  # [m] of qpos[1]: the torso has sunk by 0.55 m from the initial stand
MAX_PITCH = 0.2  # [rad]
MAX_STATE = 100.0
MAX_OBSERVED_VELOCITY = 10.0  # [m/s, rad/s]
INITIAL_NOISE = 0.005
ALIVE_BONUS = 1.0
ACTION_COST = 1e-3


@dataclasses.dataclass(frozen=True)
class Hopper:
    """Hop forward without falling. Observation: qpos[1:] (5), then qvel clipped to +-10 (6). Action: 3 torques / 200 N m.

    Attributes:
        episode_length: control steps after which an episode is truncated (paper: 2048).
    """

    episode_length: int = 2048
    observation_size: int = dataclasses.field(default=11, init=False)
    action_size: int = dataclasses.field(default=3, init=False)
    sim_dt: float = dataclasses.field(default=SIM_DT, init=False)
    num_substeps: int = dataclasses.field(default=NUM_SUBSTEPS, init=False)
    ctrl_dt: float = dataclasses.field(default=SIM_DT * NUM_SUBSTEPS, init=False)

    def sample_initial(self, robots: RobotPool, key: jax.Array) -> PhysicsState:
        """The initial stand plus uniform noise in +-0.005 on every position and velocity."""
        noise = jax.random.uniform(key, (robots.num_robots, 12), minval=-INITIAL_NOISE, maxval=INITIAL_NOISE)
        stand = jnp.zeros(6).at[1].set(INITIAL_HEIGHT)
        return PhysicsState(qpos=stand + noise[:, :6], qvel=noise[:, 6:], qacc_warmstart=jnp.zeros_like(noise[:, 6:]))

    def observe(self, physics: PhysicsState) -> jax.Array:
        velocity = jnp.clip(physics.qvel, -MAX_OBSERVED_VELOCITY, MAX_OBSERVED_VELOCITY)
        return jnp.concatenate([physics.qpos[:, 1:], velocity], axis=-1)

    def reward(self, before: PhysicsState, action: jax.Array, after: PhysicsState) -> jax.Array:
        """Forward velocity [m/s] + 1 - 1e-3 |action|^2."""
        velocity = (after.qpos[:, 0] - before.qpos[:, 0]) / self.ctrl_dt
        return velocity + ALIVE_BONUS - ACTION_COST * jnp.sum(jnp.square(action), axis=-1)

    def is_terminated(self, physics: PhysicsState) -> jax.Array:
        """Fallen: |state[2:]| >= 100, displaced height <= 0.7 or |pitch| >= 0.2 (state = qpos then qvel)."""
        state = jnp.concatenate([physics.qpos, physics.qvel], axis=-1)
        return (
            jnp.any(jnp.abs(state[:, 2:]) >= MAX_STATE, axis=-1)
            | (physics.qpos[:, 1] <= MIN_HEIGHT)
            | (jnp.abs(physics.qpos[:, 2]) >= MAX_PITCH)
        )

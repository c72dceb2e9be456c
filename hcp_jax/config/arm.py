"""Settings of the arms: their pool, their tasks and their encodings."""

import dataclasses

from hcp_jax.config.checks import MAX_SEED, is_at_least_zero, is_positive, require
from hcp_jax.hardware.arm import ALL_TYPES
from hcp_jax.hardware.arm_encodings import ARM_ENCODINGS
from hcp_jax.hardware.joint_slots import LAYOUTS
from hcp_jax.hardware.ranges import TYPE_STRIDE, ArmRanges, ChainRanges
from hcp_jax.physics.base import INTEGRATORS

_OF_POSES = ("chain_fk", "chain_fk+jacobian", "chain_fk+jacobian+dynamics", "none+end_effector", "none+goal_offset")
ARM_CONDITIONINGS = (*ARM_ENCODINGS, *_OF_POSES, "embedding")
# Those that do not depend on what other arms are trained on (dynamics are scaled by the pool's ranges).
OWN_ARM_CONDITIONINGS = ("none", "chain", *_OF_POSES)


@dataclasses.dataclass(frozen=True)
class ArmPoolConfig:
    """The arms. A pool depends on this record alone, never on the training seed.

    Attributes:
        types: robot types to train on (hcp_jax.hardware.arm); none where `robot` names an arm.
        left_out: types to evaluate zero-shot.
        robots_per_type: training robots of each type (paper: 140). Of an arm from a file: 1 is the arm as it is, more are
            variants of it whose masses and joint dynamics are drawn from `ranges`.
        heldout_per_type: robots of each type, also of those left out, that are never trained on. Of an arm from a file:
            episodes of it in an evaluation.
        seed: seed of the robots' hardware.
        split: `train`, or `new` for robots that no other pool of this seed contains (fine-tuning).
        ranges: where the hardware of types A to K, and of variants of an arm from a file, is drawn from.
        chain_ranges: where random chains, types R4 to R7, are drawn from.
    """

    types: tuple[str, ...] = tuple("ABCDEFGI")
    left_out: tuple[str, ...] = ("H",)
    robots_per_type: int = 140
    heldout_per_type: int = 25
    seed: int = 0
    split: str = "train"
    ranges: ArmRanges = ArmRanges()
    chain_ranges: ChainRanges = ChainRanges()

    def __post_init__(self):
        for field in ("types", "left_out"):
            value = getattr(self, field)
            for name in value:
                require(name in ALL_TYPES, f"pool.{field}", name, f"types out of {', '.join(ALL_TYPES)}")
            require(len(set(value)) == len(value), f"pool.{field}", value, "no type twice")
        for field in ("robots_per_type", "heldout_per_type"):
            require(getattr(self, field) >= 1, f"pool.{field}", getattr(self, field), "at least 1")
        for field in ("robots_per_type", "heldout_per_type"):
            require(getattr(self, field) <= TYPE_STRIDE, f"pool.{field}", getattr(self, field), f"at most {TYPE_STRIDE}")
        require(0 <= self.seed <= MAX_SEED, "pool.seed", self.seed, f"0 to {MAX_SEED}")
        require(self.split in ("train", "new"), "pool.split", self.split, "'train' or 'new'")

    @property
    def num_robots(self) -> int:
        return max(1, len(self.types)) * self.robots_per_type

    @property
    def num_heldout(self) -> int:
        return max(1, len({*self.types, *self.left_out})) * self.heldout_per_type


@dataclasses.dataclass(frozen=True)
class ArmConfig:
    """The arm's tasks.

    Attributes:
        integrator: `rk4` (1 ms, released code), `euler` (1 ms) or `implicitfast` (4 ms).
        random_hole: side of the cube [m] in which the hole is placed (paper: 0.2); 0 keeps it where it is.
        approach_starts: share of the training episodes of peg insertion that start with the peg upright, in the hole or up to
            0.15 m above it (a reverse curriculum, Florensa et al. 2017); evaluation never does.
        episode_length: control steps per episode (paper: 200).
        observation_noise: half-width of the uniform noise on joint angles [rad] and velocities [rad/s].
        success_distance: of the point of interest from the goal [m].
        action_cost: weight of |action|^2 in the reward.
        joint_slots: where joints stand in observations, actions and features of v_h: `packed`, zeros at the end where an arm
            has fewer than seven (paper), or `aligned`, zeros where the type lacks the joint (`hcp_jax.hardware.joint_slots`).
    """

    integrator: str = "implicitfast"
    random_hole: float = 0.0
    approach_starts: float = 0.0
    episode_length: int = 200
    observation_noise: float = 0.02
    success_distance: float = 0.02
    action_cost: float = 0.1
    joint_slots: str = "packed"

    def __post_init__(self):
        require(self.joint_slots in LAYOUTS, "env.joint_slots", self.joint_slots, f"one of {', '.join(LAYOUTS)}")
        require(self.integrator in INTEGRATORS, "env.integrator", self.integrator, f"one of {', '.join(INTEGRATORS)}")
        require(self.episode_length >= 1, "env.episode_length", self.episode_length, "at least 1")
        require(is_positive(self.success_distance), "env.success_distance", self.success_distance, "a number above 0")
        require(0.0 <= self.approach_starts <= 1.0, "env.approach_starts", self.approach_starts, "a number in [0, 1]")
        for name in ("random_hole", "observation_noise", "action_cost"):
            require(is_at_least_zero(getattr(self, name)), f"env.{name}", getattr(self, name), "a number of at least 0")

"""Settings of the hopper: its pool and its task."""

import dataclasses

from hcp_jax.config.checks import MAX_SEED, require
from hcp_jax.hardware.ranges import HopperRanges
from hcp_jax.physics.base import INTEGRATORS


@dataclasses.dataclass(frozen=True)
class HopperPoolConfig:
    """The robots. A pool depends on this record alone, never on the training seed.

    Attributes:
        num_robots: training robots (paper: 1000).
        num_heldout: robots that are never trained on, for evaluation.
        seed: seed of the robots' hardware.
        split: `train`, or `new` for robots that no other pool of this seed contains (fine-tuning).
        ranges: where the hardware is drawn from.
    """

    num_robots: int = 1000
    num_heldout: int = 100
    seed: int = 0
    split: str = "train"
    ranges: HopperRanges = HopperRanges()

    def __post_init__(self):
        require(self.num_robots >= 1, "pool.num_robots", self.num_robots, "at least 1")
        require(self.num_heldout >= 1, "pool.num_heldout", self.num_heldout, "at least 1")
        require(0 <= self.seed <= MAX_SEED, "pool.seed", self.seed, f"0 to {MAX_SEED}")
        require(self.split in ("train", "new"), "pool.split", self.split, "'train' or 'new'")


@dataclasses.dataclass(frozen=True)
class HopperConfig:
    """The hopper task.

    Attributes:
        episode_length: control steps per episode (paper: 2048).
        integrator: `rk4` (hopper.json), `euler` or `implicitfast`.
    """

    episode_length: int = 2048
    integrator: str = "rk4"

    def __post_init__(self):
        require(self.episode_length >= 1, "env.episode_length", self.episode_length, "at least 1")
        require(self.integrator in INTEGRATORS, "env.integrator", self.integrator, f"one of {', '.join(INTEGRATORS)}")

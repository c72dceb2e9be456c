"""What the training loop needs of an experiment, whatever its robots, task and algorithm."""

from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import jax

from hcp_jax.config import Config
from hcp_jax.hardware.pool import RobotPool

# Purposes of random draws from the training seed, and the fixed seed of evaluation episodes.
TRAIN, FIT = 0, 1
EVALUATION_SEED = 20180101


# A learner's state: a flax record with iteration, params, diverged [N], overflow [], sums (metrics by name); policy_fields, the
# names of what a policy without its training needs; published(), what of these a published policy holds, by name, and
# with_published(content), the state with that put in.
TrainingState = Any


class Learner(Protocol):
    """`train` donates the state's buffers."""

    @property
    def train(self) -> Callable[[TrainingState, int], TrainingState]: ...


class Experiment(Protocol):
    """A config's objects, built once and used by every command."""

    best_metric: ClassVar[str]  # the best checkpoint has the highest of it

    @property
    def config(self) -> Config: ...
    @property
    def physics(self) -> str: ...
    @property
    def train_pool(self) -> RobotPool: ...
    @property
    def heldout_pool(self) -> RobotPool: ...
    @property
    def make_env(self) -> Callable[..., Any]: ...  # of a pool
    @property
    def learner(self) -> Learner: ...
    def robot_inputs(self, pool: RobotPool) -> Callable[[jax.Array, jax.Array], jax.Array]:
        """What an agent sees of robots at index [B] of `pool` and of their obs [B, O], but for goals: [B, K]."""
        ...

    def init_state(self) -> TrainingState: ...
    def introduce(self, iteration: int) -> list[str]: ...
    def evaluate(self, state: TrainingState) -> tuple[dict[str, float | None], str]: ...
    def learner_metrics(self, state: TrainingState) -> dict[str, float | int]: ...
    def describe(self, state: TrainingState) -> str: ...

"""From a config to its experiment."""

from hcp_jax.config import Config
from hcp_jax.experiment.arm import make_arm_experiment
from hcp_jax.experiment.base import Experiment
from hcp_jax.experiment.hopper import make_hopper_experiment
from hcp_jax.physics.base import default_physics


def make_experiment(config: Config, physics: str | None = None) -> Experiment:
    """Builds the pools, compiles the robots and sets up learner and evaluator.

    Args:
        config: the run's settings.
        physics: overrules `config.physics`; may also be `native-INTEGRATOR`.
    """
    physics = physics or config.physics
    physics = default_physics() if physics == "auto" else physics
    make = make_hopper_experiment if config.task == "hopper" else make_arm_experiment
    return make(config, physics)

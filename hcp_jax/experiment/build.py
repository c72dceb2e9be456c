"""From a config to its experiment."""

from hcp_jax.config import Config
from hcp_jax.experiment.arm import ArmExperiment, make_arm_experiment
from hcp_jax.experiment.hopper import HopperExperiment, make_hopper_experiment
from hcp_jax.physics.base import default_physics


def make_experiment(config: Config, physics: str = "auto") -> ArmExperiment | HopperExperiment:
    """Builds the pools, compiles the robots and sets up learner and evaluator.

    Args:
        config: the run's settings.
        physics: engine, may be `native-INTEGRATOR`; `auto` takes the config's.
    """
    physics = config.physics if physics == "auto" else physics
    physics = default_physics() if physics == "auto" else physics
    make = make_hopper_experiment if config.task == "hopper" else make_arm_experiment
    return make(config, physics)

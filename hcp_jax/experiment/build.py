"""From a config to its experiment."""

import dataclasses

from hcp_jax.config import ArmPoolConfig, Config
from hcp_jax.config.arm import OWN_ARM_CONDITIONINGS
from hcp_jax.experiment.arm import ArmExperiment, make_arm_experiment
from hcp_jax.experiment.hopper import HopperExperiment, make_hopper_experiment
from hcp_jax.physics.build import resolve_physics


def make_experiment(config: Config, physics: str = "auto") -> ArmExperiment | HopperExperiment:
    """Builds the pools, compiles the robots and sets up learner and evaluator.

    Args:
        config: the run's settings.
        physics: engine, may be `native-INTEGRATOR`; `auto` takes the config's.
    """
    physics = config.physics if physics == "auto" else physics
    physics = resolve_physics(physics)
    make = make_hopper_experiment if config.task == "hopper" else make_arm_experiment
    return make(config, physics)


def for_own_robots(config: Config) -> Config:
    """A config whose policy plays arms from files as that of `config` does, and which is built sooner: with one robot of each
    type, where v_h does not depend on the others."""
    if not isinstance(config.pool, ArmPoolConfig) or config.encoding not in OWN_ARM_CONDITIONINGS:
        return config
    pool = dataclasses.replace(config.pool, robots_per_type=1, heldout_per_type=1)
    return dataclasses.replace(config, pool=pool, num_envs=config.resolved_num_envs)

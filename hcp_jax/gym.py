"""Our environments for agents that are not ours, as Gymnasium's `VectorEnv` and `Env`.

from hcp_jax import gym, presets
worlds = gym.make_vector_env(presets.arm("mine", "reacher", "chain_fk", left_out="H"), num_envs=128)
"""

from hcp_jax.config import Config, ConfigError
from hcp_jax.envs.base import PoolEnv
from hcp_jax.envs.gymnasium_envs import GoalVectorEnv, PoolVectorEnv, SingleEnv
from hcp_jax.experiment.build import make_experiment


def make_vector_env(config: Config, num_envs: int = 0, heldout: bool = False) -> PoolVectorEnv | GoalVectorEnv:
    """The worlds of the robots that `config` trains on, or of its held-out ones. All episodes start where evaluations start.

    Args:
        config: its pool, task, encoding and physics are used.
        num_envs: worlds; 0 stands for the config's own number.
        heldout: of held-out robots (and of types left out) instead.

    Returns:
        `Box` observations with v_h for the hopper, `Dict` ones for the arms, whose `observation` holds v_h and the features
        that no goal has a part in.

    Raises:
        ConfigError: v_h is learned (`encoding="embedding"`): it belongs to our agents.
    """
    if config.encoding == "embedding":
        raise ConfigError("encoding=embedding: a learned v_h belongs to our agents: expected a constant encoding")
    experiment = make_experiment(config)
    pool = experiment.heldout_pool if heldout else experiment.train_pool
    env = experiment.make_env(pool)
    settings = (num_envs or config.resolved_num_envs, experiment.robot_inputs(pool))
    return PoolVectorEnv(env, *settings) if isinstance(env, PoolEnv) else GoalVectorEnv(env, *settings)


def make_env(config: Config, heldout: bool = False) -> SingleEnv:
    """One world, with a robot drawn anew for each episode. Arguments as of `make_vector_env`."""
    return SingleEnv(make_vector_env(config, 1, heldout))

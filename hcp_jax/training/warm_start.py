"""Starting a run from another run's layers (paper, section 5.2: transfer to new agents)."""

import pathlib
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from hcp_jax.algorithms.ddpg import DDPGState
from hcp_jax.algorithms.identification import get_actor, put_actor
from hcp_jax.algorithms.ppo import PPO, PPOState
from hcp_jax.config import Config
from hcp_jax.devices import copy_tree
from hcp_jax.experiment.base import TrainingState
from hcp_jax.experiment.build import make_experiment
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import CheckpointError
from hcp_jax.training.policy_file import CRITIC, load_policy


def load_init(config: Config) -> Callable[[Any, TrainingState], TrainingState]:
    """Reads the run that `config.init` names; the result, called with an experiment, writes its layers into a new run's state.

    Hidden layers and statistics of the inputs carry over; an arm's run keeps these as they are, since the layers were trained
    with inputs of that scale. Output layers and the log standard deviation carry over only if `config.init_layers` is
    `all`; every robot's own v_h is new.

    Raises:
        RunFolderError, CheckpointError: that run cannot be read, its hidden layers do not fit `config`, it is still identifying
            its robots, or it is a policy that was published without its critic.
    """
    folder = pathlib.Path(config.init)
    source_config = run_folder.read_config(folder)
    for field in ("task", "encoding", *_architecture(config)):
        old, new = _get(source_config, field), _get(config, field)
        if old != new:
            raise CheckpointError(f"init={config.init}: another architecture: its {field} is {old!r}, the config's {new!r}")
    identified = {bool(each.embedding.identify_steps) for each in (source_config, config)}
    if config.encoding == "embedding" and len(identified) > 1:
        raise CheckpointError(f"init={config.init}: its v_h was learned in another way (embedding.identify_steps)")
    run = make_experiment(source_config)
    iteration, source = load_policy(folder, run)
    if isinstance(run.learner, PPO) and iteration < run.learner.identify_iterations:  # the actor to go on with is untrained
        steps = f"embedding.identify_steps={source_config.embedding.identify_steps}"
        raise CheckpointError(f"init={config.init}: is still identifying its robots; expected a run that is past its {steps}")
    if config.algorithm == "ddpg" and CRITIC not in source.params:
        raise CheckpointError(f"init={config.init}: published without its critic; start from seed 0 or a run folder")
    start = _start_ppo if config.algorithm == "ppo" else _start_ddpg
    return lambda run, state: start(source, state, config.init_layers == "all")


def _architecture(config: Config) -> tuple[str, ...]:
    """Fields that say what the networks are and what they see."""
    if config.algorithm == "ppo":
        fields = ("ppo.hidden_sizes", "ppo.normalize_observation")
    else:
        names = ("network", "hidden_sizes", "layer_norm", "normalize_inputs", "double_critic")
        fields = ("env.joint_slots", *(f"ddpg.{name}" for name in names))
    return (*fields, "embedding.size") if config.encoding == "embedding" else fields


def _start_ppo(source: PPOState, state: PPOState, all_layers: bool) -> PPOState:
    """Where robots are identified, the new ones are so first, with the old run's forward model and the actor that it
    identified its robots under."""
    old, network = source.params["network"], state.params["network"]
    if all_layers:
        network = copy_tree(old)
    else:
        network = copy_tree(take_hidden_layers(old, network))
        if "forward_model" in network["params"]:
            network["params"]["forward_model"] = copy_tree(old["params"]["forward_model"])
    obs_statistics, reserve = copy_tree(source.obs_statistics), None
    if source.reserve is not None:
        reserve = get_actor({"network": network}, obs_statistics)
        network = put_actor(copy_tree(source.reserve), network)
        obs_statistics = copy_tree(source.reserve.obs_statistics)
    return state.replace(
        params={"network": network, "embedding": _centre_embedding(source, state)},
        reserve=reserve,
        obs_statistics=obs_statistics,
        model_statistics=copy_tree(source.model_statistics),
    )


def _start_ddpg(source: DDPGState, state: DDPGState, all_layers: bool) -> DDPGState:
    """With the mean of the actors, the policy that the old run is known by."""
    networks = {name: source.params[name] for name in state.target_params} | {"actor": source.average_actor}
    if not all_layers:
        networks = {name: take_hidden_layers(old, state.params[name]) for name, old in networks.items()}
    return state.replace(
        params=copy_tree(networks) | {"embedding": _centre_embedding(source, state)},
        target_params=copy_tree(networks),
        average_actor=copy_tree(networks["actor"]),
        statistics=copy_tree(source.statistics),
    )


def _centre_embedding(source: PPOState | DDPGState, state: PPOState | DDPGState) -> jax.Array | None:
    """Fresh rows around the mean of the old run's."""
    embedding = state.params["embedding"]
    return None if embedding is None else embedding + jnp.mean(source.params["embedding"], axis=0)


def take_hidden_layers(old: Any, new: Any) -> Any:
    """`new` with the hidden layers of `old`, a tree of the same structure."""

    def pick(path, old_leaf, new_leaf):
        return old_leaf if any(str(getattr(key, "key", "")).startswith("hidden") for key in path) else new_leaf

    return jax.tree_util.tree_map_with_path(pick, old, new)


def _get(config: Config, path: str):
    value = config
    for name in path.split("."):
        value = getattr(value, name)
    return value

"""Starting a run from another run's hidden layers (paper, section 5.2: transfer to new agents)."""

import pathlib
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from hcp_jax.algorithms.ddpg import DDPGState
from hcp_jax.algorithms.ppo import PPOState, get_actor, put_actor
from hcp_jax.config import Config
from hcp_jax.experiment.base import Experiment, TrainingState
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.hopper import copy_tree
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import CheckpointError, Checkpoints
from hcp_jax.training.policy_file import POLICY_FILE, read_policy


def load_policy(folder: pathlib.Path, run: Experiment, best: bool = False) -> tuple[int, Any]:
    """An initial state with the newest readable policy of a run folder, or its best one, and its number of iterations.

    A folder may also be a published policy: one with `policy.msgpack` instead of checkpoints.
    """
    checkpoint_folder = folder / run_folder.CHECKPOINT_FOLDER
    if not checkpoint_folder.is_dir():
        if (folder / POLICY_FILE).exists():
            state = read_policy(folder, run.init_state())
            return int(state.iteration), state
        raise CheckpointError(f"{folder}: holds no checkpoint")
    checkpoints = Checkpoints(checkpoint_folder, read_only=True)
    try:
        if best:
            return checkpoints.restore_best(run.init_state())
        iteration, state, skipped = checkpoints.restore(run.init_state(), policy_only=True)
        for line in skipped:
            print(line, flush=True)
        return iteration, state
    finally:
        checkpoints.close()


def load_init(config: Config) -> Callable[[Any, TrainingState], TrainingState]:
    """Reads the run that `config.init` names; the result, called with an experiment, writes its layers into a new run's state.

    Hidden layers and statistics carry over; output layers and the log standard deviation only if `config.init_layers` is
    `all`; every robot's own v_h is new.

    Raises:
        RunFolderError, CheckpointError: that run cannot be read, or its hidden layers do not fit `config`.
    """
    folder = pathlib.Path(config.init)
    source_config = run_folder.read_config(folder)
    for field in ("task", "encoding", f"{config.algorithm}.hidden_sizes", "embedding.size"):
        old, new = _get(source_config, field), _get(config, field)
        if old != new:
            raise CheckpointError(f"init={config.init}: another architecture: its {field} is {old!r}, the config's {new!r}")
    if bool(source_config.embedding.identify_steps) != bool(config.embedding.identify_steps):
        raise CheckpointError(f"init={config.init}: its v_h was learned in another way (embedding.identify_steps)")
    source = load_policy(folder, make_experiment(source_config))[1]
    start = _start_ppo if config.algorithm == "ppo" else _start_ddpg
    return lambda run, state: start(source, state, config.init_layers == "all")


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
    networks = {name: source.params[name] for name in state.target_params}
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

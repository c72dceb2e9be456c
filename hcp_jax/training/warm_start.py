"""Starting a run from another run's hidden layers (paper, section 5.2: transfer to new agents)."""

import pathlib
from collections.abc import Callable

import jax.numpy as jnp

from hcp_jax.algorithms.ppo import PPOState, get_actor, put_actor
from hcp_jax.config import Config
from hcp_jax.experiment import Experiment, copy_tree, make_experiment
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import CheckpointError, Checkpoints
from hcp_jax.training.policy_file import POLICY_FILE, read_policy


def load_state(folder: pathlib.Path, run: Experiment, best: bool = False) -> tuple[int, PPOState]:
    """The newest readable state of a run folder, or its best one, and its number of iterations.

    A published policy (a folder with `policy.msgpack` instead of checkpoints) gives an initial state with that policy.
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
        iteration, state, skipped = checkpoints.restore(run.init_state())
        for line in skipped:
            print(line, flush=True)
        return iteration, state
    finally:
        checkpoints.close()


def load_init(config: Config) -> Callable[[Experiment, PPOState], PPOState]:
    """Reads the run that `config.init` names; the result writes its hidden layers into a new run's state.

    Hidden layers, observation statistics and the centre of the embedding carry over; output layers, the log standard
    deviation and every robot's own v_h are new. Where robots are identified, the new ones are so first, with the old run's
    forward model and the actor that it identified its robots under.

    Raises:
        RunFolderError, CheckpointError: that run cannot be read, or its hidden layers do not fit `config`.
    """
    folder = pathlib.Path(config.init)
    source_config = run_folder.read_config(folder)
    for field in ("encoding", "ppo.hidden_sizes", "embedding.size"):
        old, new = _get(source_config, field), _get(config, field)
        if old != new:
            raise CheckpointError(f"init={config.init}: another architecture: its {field} is {old!r}, the config's {new!r}")
    if bool(source_config.embedding.identify_steps) != bool(config.embedding.identify_steps):
        raise CheckpointError(f"init={config.init}: its v_h was learned in another way (embedding.identify_steps)")
    source = load_state(folder, make_experiment(source_config))[1]

    def init(run: Experiment, state: PPOState) -> PPOState:
        network = copy_tree(state.params["network"])
        for part, layers in network["params"].items():
            for layer in layers if isinstance(layers, dict) else ():
                if layer.startswith("hidden") or part == "forward_model":
                    layers[layer] = copy_tree(source.params["network"]["params"][part][layer])
        obs_statistics, reserve = copy_tree(source.obs_statistics), None
        if source.reserve is not None:
            reserve = get_actor({"network": network}, obs_statistics)
            network = put_actor(copy_tree(source.reserve), network)
            obs_statistics = copy_tree(source.reserve.obs_statistics)
        embedding = state.params["embedding"]
        if embedding is not None:
            embedding = embedding + jnp.mean(source.params["embedding"], axis=0)
        return state.replace(
            params={"network": network, "embedding": embedding},
            reserve=reserve,
            obs_statistics=obs_statistics,
            model_statistics=copy_tree(source.model_statistics),
        )

    return init


def _get(config: Config, path: str):
    value = config
    for name in path.split("."):
        value = getattr(value, name)
    return value

"""A policy without the state of its training: read from a run's checkpoints, or from one file that can be published."""

import pathlib
from typing import Any

import flax.serialization
import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.algorithms.optimizers import mark_kernels
from hcp_jax.devices import shapes_of
from hcp_jax.errors import one_line
from hcp_jax.experiment.base import Experiment, TrainingState
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import CheckpointError, Checkpoints, check_architecture, leaf_name

CRITIC = "critic"  # of DDPG's networks the one that is not played


def write_policy(folder: pathlib.Path, state: TrainingState, critic: bool = True) -> pathlib.Path:
    """Writes `policy.msgpack`: the kernels of networks as float16, the rest as float32. Returns its path.

    Without the critic of DDPG, which is half of the file, a policy plays as before, and no training starts from it.
    """
    content = jax.device_get(flax.serialization.to_state_dict(state.published()))
    if not critic:
        content["params"].pop(CRITIC, None)
    rounded = jax.tree.map(lambda leaf, half: leaf.astype(np.float16) if half else leaf, content, mark_kernels(content))
    path = folder / run_folder.POLICY_FILE
    path.write_bytes(flax.serialization.msgpack_serialize(rounded))
    return path


def read_policy(folder: pathlib.Path, template: TrainingState) -> TrainingState:
    """`template`, a state of arrays or of their shapes, with the policy put in; of one without its critic `params` has none.

    Raises:
        CheckpointError: the file is damaged, was written by another version, or is of another architecture than `template`.
    """
    path = folder / run_folder.POLICY_FILE
    content = path.read_bytes()
    try:
        fields = flax.serialization.msgpack_restore(content)
    except Exception as error:  # flax and msgpack raise many kinds for damaged files
        raise CheckpointError(f"{path}: damaged ({type(error).__name__})") from error
    expected = template.published().keys()
    if not isinstance(fields, dict) or fields.keys() != expected:
        held = ", ".join(map(str, fields)) if isinstance(fields, dict) else type(fields).__name__
        raise CheckpointError(f"{path}: holds {held}, not {', '.join(expected)}: of another version; collect its run anew")
    if isinstance(fields["params"], dict) and CRITIC not in fields["params"]:
        template = template.replace(params={name: leaf for name, leaf in template.params.items() if name != CRITIC})
    shapes = {leaf_name(path): np.shape(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(fields)}
    check_architecture(shapes, template, str(path))
    try:
        policy = flax.serialization.from_state_dict(template.published(), jax.tree.map(_widen, fields))
    except (ValueError, TypeError) as error:
        raise CheckpointError(f"{path}: another architecture ({one_line(error)})") from error
    return template.with_published(policy)


def _widen(leaf: np.ndarray | int) -> jax.Array:
    """What was written as float16, as float32."""
    return jnp.asarray(leaf, jnp.float32) if np.asarray(leaf).dtype == np.float16 else jnp.asarray(leaf)


def load_policy(folder: pathlib.Path, run: Experiment, best: bool = False) -> tuple[int, Any]:
    """The newest readable policy of a run folder, or its best one, and its number of iterations.

    A folder may also be a published policy: one with `policy.msgpack` instead of checkpoints.

    Returns:
        iterations, and a state whose `policy_fields` hold the policy; its other fields hold the shapes of arrays.

    Raises:
        CheckpointError: there is no policy, it cannot be read, or it is of another architecture.
    """
    template = shapes_of(run.init_state)
    checkpoint_folder = folder / run_folder.CHECKPOINT_FOLDER
    if not checkpoint_folder.is_dir():
        if (folder / run_folder.POLICY_FILE).exists():
            if best:
                raise CheckpointError(f"--best: {folder} is a published policy, which is one alone")
            state = read_policy(folder, template)
            return int(state.iteration), state
        raise CheckpointError(f"{folder}: holds no checkpoint")
    checkpoints = Checkpoints(checkpoint_folder, read_only=True)
    try:
        if best:
            return checkpoints.restore_best(template)
        iteration, state, skipped = checkpoints.restore(template, policy_only=True)
        for line in skipped:
            print(line, flush=True)
        return iteration, state
    finally:
        checkpoints.close()

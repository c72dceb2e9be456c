"""A policy without the state of its training: one file, small enough to publish, and data only."""

import pathlib

import flax.serialization
import jax
import numpy as np

from hcp_jax.experiment.base import TrainingState
from hcp_jax.training.checkpoint import CheckpointError, check_architecture, leaf_name

POLICY_FILE = "policy.msgpack"


def write_policy(folder: pathlib.Path, state: TrainingState) -> pathlib.Path:
    """Writes `policy.msgpack`: networks, embedding and statistics, float32. Returns its path."""
    content = flax.serialization.to_state_dict({name: getattr(state, name) for name in state.policy_fields})
    path = folder / POLICY_FILE
    path.write_bytes(flax.serialization.msgpack_serialize(jax.device_get(content)))
    return path


def read_policy(folder: pathlib.Path, template: TrainingState) -> TrainingState:
    """`template` with the policy put in.

    Raises:
        CheckpointError: the file is damaged, or of another architecture than `template`.
    """
    path = folder / POLICY_FILE
    try:
        content = flax.serialization.msgpack_restore(path.read_bytes())
        fields = {name: content[name] for name in template.policy_fields}
    except (ValueError, KeyError, TypeError) as error:
        raise CheckpointError(f"{path}: damaged ({type(error).__name__})") from error
    shapes = {leaf_name(path): np.shape(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(fields)}
    check_architecture(shapes, template, str(path))
    return template.replace(
        **flax.serialization.from_state_dict({name: getattr(template, name) for name in template.policy_fields}, fields)
    )

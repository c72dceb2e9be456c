import flax.serialization
import jax
import numpy as np
import pytest

from hcp_jax.experiment.build import make_experiment
from hcp_jax.training.checkpoint import CheckpointError
from hcp_jax.training.policy_file import load_policy, read_policy, write_policy


@pytest.fixture(scope="module")
def trained(finished_arms, tiny_arms):
    """A trained state whose mean of the actors is far from its last one."""
    state = load_policy(finished_arms, make_experiment(tiny_arms))[1]
    return state.replace(average_actor=jax.tree.map(lambda leaf: leaf + 1.0, state.average_actor))


def test_a_published_policy_has_one_actor_and_it_is_the_mean(trained, tmp_path):
    write_policy(tmp_path, trained)
    read = read_policy(tmp_path, trained)
    for actor in (read.params["actor"], read.average_actor):
        jax.tree.map(lambda one, mean: np.testing.assert_allclose(one, mean, rtol=1e-3), actor, trained.average_actor)
    kernels = [shape for path, shape in _shapes(tmp_path) if "actor" in path and "hidden_0" in path and "kernel" in path]
    assert len(kernels) == 1


def test_a_policy_without_its_critic_is_smaller_and_plays_as_before(trained, tiny_arms, tmp_path):
    learner = make_experiment(tiny_arms).learner
    whole = learner.policy(read_policy(write_policy(tmp_path, trained).parent, trained))
    size = (tmp_path / "policy.msgpack").stat().st_size
    path = write_policy(tmp_path, trained, critic=False)
    alone = learner.policy(read_policy(tmp_path, trained))
    assert path.stat().st_size < 0.7 * size
    assert whole[0].keys() - alone[0].keys() == {"critic"}
    jax.tree.map(np.testing.assert_array_equal, (alone[0]["actor"], alone[1]), (whole[0]["actor"], whole[1]))


def test_a_policy_without_its_actor_is_refused(trained, tmp_path):
    path = write_policy(tmp_path, trained, critic=False)
    content = flax.serialization.msgpack_restore(path.read_bytes())
    del content["params"]["actor"]
    path.write_bytes(flax.serialization.msgpack_serialize(content))
    with pytest.raises(CheckpointError, match="it has no params/actor"):
        read_policy(tmp_path, trained)


def test_a_policy_of_another_version_is_refused_by_what_it_holds(trained, tmp_path):
    path = write_policy(tmp_path, trained)
    content = flax.serialization.msgpack_restore(path.read_bytes())
    for changed, held in (
        (content | {"average_actor": content["params"]["actor"]}, "holds average_actor, iteration, params, statistics, not"),
        ([1, 2], "holds list, not iteration, params, statistics"),
    ):
        path.write_bytes(flax.serialization.msgpack_serialize(changed))
        with pytest.raises(CheckpointError, match=held):
            read_policy(tmp_path, trained)


def test_a_flipped_bit_is_a_damaged_policy_or_another_one_but_no_crash(trained, tmp_path):
    path = write_policy(tmp_path, trained)
    content = path.read_bytes()
    refused = 0
    for place in range(0, 600, 5):
        flipped = content[place] ^ (1 << place % 8)
        path.write_bytes(content[:place] + bytes([flipped]) + content[place + 1 :])
        try:
            read_policy(tmp_path, trained)
        except CheckpointError:
            refused += 1
    assert refused > 10


def _shapes(folder):
    content = flax.serialization.msgpack_restore((folder / "policy.msgpack").read_bytes())
    return [(jax.tree_util.keystr(path), leaf.shape) for path, leaf in jax.tree_util.tree_leaves_with_path(content)]

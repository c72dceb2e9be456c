import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax.algorithms.her import relabel_goals
from hcp_jax.algorithms.replay import (
    EpisodeBatch,
    Replay,
    add_episodes,
    episode_shapes,
    init_replay,
    replay_bytes,
    sample_steps,
)

LENGTH, CAPACITY = 6, 5


def coded_episodes(first: int, count: int, length: int = LENGTH) -> EpisodeBatch:
    """Episodes whose every number says which episode and step it is of: 100 * episode + state."""
    code = 100.0 * jnp.arange(first, first + count)[:, None, None] + jnp.arange(LENGTH + 1)[None, :, None]
    return EpisodeBatch(
        obs=jnp.tile(code, (1, 1, 2)),
        achieved_goal=jnp.tile(code, (1, 1, 3)),
        action=code[:, :-1],
        desired_goal=jnp.full((count, 3), -1.0),
        index=jnp.arange(first, first + count, dtype=jnp.int32),
        length=jnp.full(count, length, jnp.int32),
    )


def filled(*batches: EpisodeBatch) -> Replay:
    replay = init_replay(episode_shapes(CAPACITY, LENGTH, 2, 1, 3))
    for batch in batches:
        replay = add_episodes(replay, batch)
    return replay


def test_episodes_stay_whole_and_the_oldest_go_first_when_the_buffer_wraps_around(key):
    replay = filled(coded_episodes(0, 3), coded_episodes(3, 3), coded_episodes(6, 3))
    assert sorted(replay.episodes.index.tolist()) == [4, 5, 6, 7, 8]
    sample = sample_steps(replay, key, 500)
    code = 100 * sample.index + sample.step
    np.testing.assert_array_equal(sample.obs[:, 0], code)
    np.testing.assert_array_equal(sample.action[:, 0, 0], code)
    np.testing.assert_array_equal(sample.next_obs[:, 1], code + 1)
    np.testing.assert_array_equal(sample.achieved_goal[:, 0, 2], code + 1)
    assert len(np.unique(code)) == CAPACITY * LENGTH, "every step of every episode is drawn"


def test_only_what_was_added_is_sampled(key):
    sample = sample_steps(filled(coded_episodes(7, 2)), key, 200)
    assert set(sample.index.tolist()) == {7, 8}


def test_steps_after_an_episodes_length_are_never_learned_from(key):
    replay = filled(coded_episodes(1, 2, length=2), coded_episodes(3, 1, length=0))
    sample = sample_steps(replay, key, 500)
    assert set(sample.step[sample.index < 3].tolist()) == {0, 1}
    np.testing.assert_array_equal(sample.valid, sample.index != 3)


def test_runs_of_steps_stay_in_their_episode_and_end_with_it(key):
    replay = filled(coded_episodes(0, 5, length=3))
    sample = sample_steps(replay, key, 500, max_steps=4)
    np.testing.assert_array_equal(sample.num_steps, 3 - sample.step)
    first, last = 100 * sample.index + sample.step, 100 * sample.index + 3
    np.testing.assert_array_equal(sample.next_obs[:, 1], last)
    for ahead in range(3):
        counts = np.asarray(sample.num_steps) > ahead
        np.testing.assert_array_equal(sample.action[counts, ahead, 0], first[counts] + ahead)
        np.testing.assert_array_equal(sample.achieved_goal[counts, ahead, 2], first[counts] + ahead + 1)


def test_runs_are_as_long_as_asked(key):
    sample = sample_steps(filled(coded_episodes(0, 5)), key, 500, max_steps=4, num_steps=jnp.int32(1))
    np.testing.assert_array_equal(sample.num_steps, 1)
    np.testing.assert_array_equal(sample.next_obs[:, 1], sample.obs[:, 1] + 1)


def test_more_episodes_than_the_buffer_holds_are_refused():
    with pytest.raises(ValueError, match="6 episodes do not fit a buffer of 5"):
        filled(coded_episodes(0, 6))


def test_the_size_in_bytes_is_what_the_buffer_takes():
    leaves = jax.tree.leaves(filled().episodes)
    assert replay_bytes(episode_shapes(CAPACITY, LENGTH, 2, 1, 3)) == sum(leaf.nbytes for leaf in leaves)


@pytest.mark.parametrize(("strategy", "future_k"), [("none", 4), ("future", 0)])
def test_goals_stay_what_they_were_without_hindsight(key, strategy, future_k):
    replay = filled(coded_episodes(0, 5))
    sample = sample_steps(replay, key, 100)
    np.testing.assert_array_equal(relabel_goals(replay, sample, key, strategy, future_k), sample.desired_goal)


def test_future_goals_come_from_the_rest_of_the_same_episode_own_step_included(key):
    replay = filled(coded_episodes(0, 5, length=4))
    sample = sample_steps(replay, jax.random.key(1), 4000)
    goal = np.asarray(relabel_goals(replay, sample, key, "future", 4))[:, 0]
    relabelled = goal >= 0
    assert relabelled.mean() == pytest.approx(0.8, abs=0.03)
    state = goal[relabelled] - 100 * np.asarray(sample.index)[relabelled]
    ahead = state - np.asarray(sample.step)[relabelled]
    assert ahead.min() == 1
    assert state.max() == 4
    first = ahead[np.asarray(sample.step)[relabelled] == 0]
    np.testing.assert_allclose(np.bincount(first.astype(int))[1:] / len(first), 0.25, atol=0.05)


def test_final_goals_are_what_the_episode_achieved_last(key):
    replay = filled(coded_episodes(0, 5, length=4))
    sample = sample_steps(replay, jax.random.key(1), 200)
    goal = np.asarray(relabel_goals(replay, sample, key, "final", 4))[:, 0]
    relabelled = goal >= 0
    np.testing.assert_array_equal(goal[relabelled], 100 * np.asarray(sample.index)[relabelled] + 4)


def test_of_many_future_goals_the_nearest_to_the_episodes_own_is_taken(key):
    replay = filled(coded_episodes(0, 5, length=4))  # desired goals of -1: what is achieved first is nearest
    sample = sample_steps(replay, jax.random.key(1), 200)
    goal = np.asarray(relabel_goals(replay, sample, key, "future", 4, num_candidates=100))[:, 0]
    relabelled = goal >= 0
    first_ahead = 100 * np.asarray(sample.index) + np.asarray(sample.step) + 1
    np.testing.assert_array_equal(goal[relabelled], first_ahead[relabelled])

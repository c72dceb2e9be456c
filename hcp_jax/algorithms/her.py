"""Hindsight experience replay, relabelled when sampling (Andrychowicz et al. 2017; paper, section 3.3)."""

import jax
import jax.numpy as jnp

from hcp_jax.algorithms.replay import Replay, StepSample, sample_below


def relabel_goals(
    replay: Replay, sample: StepSample, key: jax.Array, strategy: str, future_k: int, num_candidates: int = 1
) -> jax.Array:
    """The goals to learn from: k of k + 1 samples get a goal that their own episode achieved, the others keep theirs.

    `future` takes the state after a step drawn uniformly from the sample's own to the episode's last; of `num_candidates` such
    states the one nearest to the episode's own goal. `final` takes the state after the last step.

    Returns:
        desired goals [N, G].
    """
    if strategy == "none" or future_k == 0:
        return sample.desired_goal
    key_keep, key_future = jax.random.split(key)
    length = replay.episodes.length[sample.row]
    if strategy == "final":
        relabelled = replay.episodes.achieved_goal[sample.row, jnp.maximum(length, 1)]
    else:
        relabelled = draw_future_goals(replay, sample, key_future, num_candidates)
    is_relabelled = jax.random.uniform(key_keep, length.shape) < future_k / (future_k + 1)
    return jnp.where(is_relabelled[:, None], relabelled, sample.desired_goal)


def draw_future_goals(replay: Replay, sample: StepSample, key: jax.Array, num_candidates: int) -> jax.Array:
    """Of goals achieved after steps drawn from each sample's own to its episode's last, the nearest to its own goal: [N, G]."""
    remaining = jnp.maximum(replay.episodes.length[sample.row] - sample.step, 1)
    keys = jax.random.split(key, num_candidates)
    steps = sample.step + jax.vmap(sample_below, in_axes=(0, None))(keys, remaining)
    candidates = replay.episodes.achieved_goal[sample.row, steps + 1]
    distances = jnp.linalg.norm(candidates - sample.desired_goal, axis=-1)
    return jnp.take_along_axis(candidates, jnp.argmin(distances, axis=0)[None, :, None], axis=0)[0]

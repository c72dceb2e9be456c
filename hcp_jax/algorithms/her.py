"""Hindsight experience replay, relabelled when sampling (Andrychowicz et al. 2017; paper, section 3.3)."""

import jax
import jax.numpy as jnp

from hcp_jax.algorithms.replay import Replay, StepSample, sample_below


def relabel_goals(replay: Replay, sample: StepSample, key: jax.Array, strategy: str, future_k: int) -> jax.Array:
    """The goals to learn from: k of k + 1 samples get a goal that their own episode achieved, the others keep theirs.

    `future` takes the state after a step drawn uniformly from the sample's own to the episode's last, `final` the state after
    the last.

    Returns:
        desired goals [N, G].
    """
    if strategy == "none" or future_k == 0:
        return sample.desired_goal
    key_keep, key_future = jax.random.split(key)
    length = replay.episodes.length[sample.row]
    last = jnp.maximum(length - 1, 0)
    step = last
    if strategy == "future":
        step = sample.step + sample_below(key_future, jnp.maximum(length - sample.step, 1))
    achieved = replay.episodes.achieved_goal[sample.row, step + 1]
    relabelled = jax.random.uniform(key_keep, step.shape) < future_k / (future_k + 1)
    return jnp.where(relabelled[:, None], achieved, sample.desired_goal)

"""A ring buffer of whole episodes on the device (the paper's replay buffer, kept by episode so that goals can be relabelled).

Axes: E episodes of the buffer, B episodes added at once, N samples, T steps of an episode.
"""

import chex
import jax
import jax.numpy as jnp
from flax import struct


@struct.dataclass
class EpisodeBatch:
    """Episodes of T steps. Step t leads from state t to state t + 1.

    obs: [B, T + 1, O]; achieved_goal: [B, T + 1, G]; action: [B, T, A]; desired_goal: [B, G]; index: [B] int32, the robot;
    length: [B] int32, steps that may be learned from (0 to T).
    """

    obs: jax.Array
    achieved_goal: jax.Array
    action: jax.Array
    desired_goal: jax.Array
    index: jax.Array
    length: jax.Array


@struct.dataclass
class Replay:
    """episodes: an `EpisodeBatch` with leading axis E; num_added: [] int32 episodes ever added."""

    episodes: EpisodeBatch
    num_added: jax.Array

    @property
    def capacity(self) -> int:
        return self.episodes.index.shape[0]

    @property
    def size(self) -> jax.Array:
        """Episodes held: [] int32."""
        return jnp.minimum(self.num_added, self.capacity)


@struct.dataclass
class StepSample:
    """N runs of up to K steps, each of an episode drawn uniformly.

    row: [N] of the buffer; step: [N] the first of the run; num_steps: [N] int32, K or as many as the episode has left;
    valid: [N] bool, False for an episode that has nothing to learn from; obs: [N, O] before the run, next_obs: after it;
    action: [N, K, A] and achieved_goal: [N, K, G], of the states stepped to, of which those from `num_steps` on mean nothing.
    The rest as in `EpisodeBatch`.
    """

    row: jax.Array
    step: jax.Array
    num_steps: jax.Array
    valid: jax.Array
    obs: jax.Array
    action: jax.Array
    next_obs: jax.Array
    achieved_goal: jax.Array
    desired_goal: jax.Array
    index: jax.Array


def episode_shapes(
    num_episodes: int, episode_length: int, observation_size: int, action_size: int, goal_size: int
) -> EpisodeBatch:
    """Shapes and types of an `EpisodeBatch`, as `jax.ShapeDtypeStruct`s."""
    return jax.eval_shape(
        lambda: EpisodeBatch(
            obs=jnp.zeros((num_episodes, episode_length + 1, observation_size)),
            achieved_goal=jnp.zeros((num_episodes, episode_length + 1, goal_size)),
            action=jnp.zeros((num_episodes, episode_length, action_size)),
            desired_goal=jnp.zeros((num_episodes, goal_size)),
            index=jnp.zeros(num_episodes, jnp.int32),
            length=jnp.zeros(num_episodes, jnp.int32),
        )
    )


def replay_bytes(shapes: EpisodeBatch) -> int:
    """Size of a buffer of such episodes."""
    return sum(leaf.size * leaf.dtype.itemsize for leaf in jax.tree.leaves(shapes))


def init_replay(shapes: EpisodeBatch) -> Replay:
    """An empty buffer of the capacity of `shapes`."""
    return Replay(jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes), jnp.int32(0))


def add_episodes(replay: Replay, episodes: EpisodeBatch) -> Replay:
    """Puts B episodes after the newest, over the oldest ones. Raises ValueError if B is more than the capacity."""
    num_new = episodes.index.shape[0]
    if num_new > replay.capacity:
        raise ValueError(f"{num_new} episodes do not fit a buffer of {replay.capacity}")
    rows = (replay.num_added + jnp.arange(num_new)) % replay.capacity
    stored = jax.tree.map(lambda buffer, new: buffer.at[rows].set(new), replay.episodes, episodes)
    return Replay(stored, replay.num_added + num_new)


def sample_steps(
    replay: Replay, key: jax.Array, num_samples: int, max_steps: int = 1, num_steps: jax.Array | int | None = None
) -> StepSample:
    """Draws first steps uniformly from the episodes held, which must not be none, and those that follow them.

    Args:
        replay: the buffer.
        key: of the draws.
        num_samples: runs of steps.
        max_steps: K, the longest a run can be.
        num_steps: [] how long they are, if the episode goes on so long; at most and by default `max_steps`.
    """
    key_row, key_step = jax.random.split(key)
    episodes = replay.episodes
    row = jax.random.randint(key_row, (num_samples,), 0, jnp.maximum(replay.size, 1))
    length = episodes.length[row]
    step = sample_below(key_step, jnp.maximum(length, 1))
    num_steps = jnp.clip(length - step, 1, max_steps if num_steps is None else num_steps)
    run = jnp.minimum(step[:, None] + jnp.arange(max_steps), episodes.action.shape[1] - 1)
    return StepSample(
        row=row,
        step=step,
        num_steps=num_steps,
        valid=length > 0,
        obs=episodes.obs[row, step],
        action=episodes.action[row[:, None], run],
        next_obs=episodes.obs[row, step + num_steps],
        achieved_goal=episodes.achieved_goal[row[:, None], run + 1],
        desired_goal=episodes.desired_goal[row],
        index=episodes.index[row],
    )


def sample_below(key: jax.Array, bound: jax.Array) -> jax.Array:
    """Uniform integers in [0, bound), for bounds [N] of at least 1: [N] int32."""
    chex.assert_rank(bound, 1)
    return jnp.minimum((jax.random.uniform(key, bound.shape) * bound).astype(jnp.int32), bound - 1)

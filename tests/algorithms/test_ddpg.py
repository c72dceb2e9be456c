import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.training.acme import running_statistics
from goal_probes import PlaneEnv, PlaneInputs

from hcp_jax.algorithms.ddpg import DDPG, DDPGState
from hcp_jax.algorithms.replay import sample_steps
from hcp_jax.config import ConfigError, DDPGConfig

CONFIG = DDPGConfig(
    hidden_sizes=(64, 64),
    actor_learning_rate=1e-3,
    critic_learning_rate=3e-3,
    critic_weight_decay=0.0,
    gamma=0.9,
    tau=0.05,
    batch_size=128,
    buffer_episodes=200,
    warmup_episodes=20,
    updates_per_iteration=50,
    exploration_noise=0.2,
)


@functools.cache
def make(turns=(0.0,), learned=False, diverging=False, same_goal=False, **changes) -> DDPG:
    """One learner, compiled once, for every test that asks for the same."""
    env = PlaneEnv(turns, diverging=diverging, same_goal=same_goal)
    config = dataclasses.replace(CONFIG, **changes)
    return DDPG(env, PlaneInputs(len(turns), learned), config, num_envs=10, num_iterations=40, embedding_learning_rate=3e-3)


def success_rate(learner: DDPG, state: DDPGState, num_episodes: int = 200) -> float:
    """Share of episodes without exploration that reach their goal."""
    index = jnp.arange(num_episodes, dtype=jnp.int32) % learner.env.num_robots
    env_state, reached = learner.env.reset(jax.random.key(7), index), jnp.zeros(num_episodes, bool)
    for _ in range(learner.env.episode_length):
        action = learner.mean_action(*learner.policy(state), learner.conditioning, index, env_state.obs, env_state.desired_goal)
        env_state, transition = learner.env.step(env_state, action)
        reached |= transition.success
    return float(reached.mean())


def trained(learner: DDPG, num_iterations: int = 40, seed: int = 0) -> DDPGState:
    return learner.train(learner.init(jax.random.key(seed)), num_iterations)


def test_a_sparse_goal_is_learned_with_hindsight_and_not_without():
    with_hindsight, without = (make(relabel=relabel) for relabel in ("future", "none"))
    # After 20 iterations; after 40 a seed in three finds the goal by chance.
    assert success_rate(with_hindsight, trained(with_hindsight, 20)) > 0.9
    assert success_rate(without, trained(without, 20)) < 0.5


def test_learning_rates_have_fallen_to_their_decay_at_the_end_of_the_run():
    learner = make(learning_rate_decay=0.0, critic_weight_decay=0.0, warmup_episodes=0)
    at_start, at_end = (trained(learner, number).params for number in (2, 40))
    learning, stopped = (
        max(float(jnp.abs(a - b).max()) for a, b in zip(jax.tree.leaves(params), jax.tree.leaves(after), strict=True))
        for params, after in ((at_start, trained(learner, 3).params), (at_end, trained(learner, 41).params))
    )
    assert learning > 1e-3
    assert stopped < 1e-6


def test_robots_that_turn_their_actions_apart_are_solved_with_an_embedding_and_not_without():
    """69 degrees to either side. At 180 degrees apart DDPG often ends where one robot is solved and the other is not."""
    turns = (1.2, -1.2)
    embedded, blind = (make(turns, learned=learned, updates_per_iteration=100) for learned in (True, False))
    for seed in (0, 1):
        assert success_rate(embedded, trained(embedded, seed=seed)) > 0.9
        assert success_rate(blind, trained(blind, seed=seed)) < 0.7


def test_the_value_of_a_success_is_its_reward_and_a_failure_is_discounted_for_ever():
    learner = make(updates_per_iteration=400, critic_learning_rate=1e-2)
    state = learner.init(jax.random.key(0))
    replay = trained(learner, 3).replay
    sample = sample_steps(replay, jax.random.key(1), 64)
    hit = sample.achieved_goal[:, 0]
    miss = jnp.full_like(hit, 9.0)
    params, optimiser, target = state.params, state.opt_state, state.target_params

    @jax.jit
    def update(params, optimiser, target, goal):
        grads, _ = jax.grad(learner._loss, has_aux=True)(params, target, state.statistics, sample, goal)
        updates, optimiser = learner._optimizer.update(grads, optimiser, params)
        params = jax.tree.map(jnp.add, params, updates)
        target = jax.tree.map(lambda t, p: t + 0.05 * (p - t), target, {k: params[k] for k in target})
        return params, optimiser, target

    for _ in range(600):
        params, optimiser, target = update(params, optimiser, target, jnp.where(jnp.arange(64)[:, None] < 32, hit, miss))
    inputs = learner.conditioning.inputs(None, sample.index, sample.obs, jnp.where(jnp.arange(64)[:, None] < 32, hit, miss))
    values = learner._values(params["critic"], inputs, sample.action[:, 0])[0]
    cost = 0.05 * jnp.sum(jnp.square(sample.action[:, 0]), axis=-1)
    np.testing.assert_allclose(values[:32], 1.0 - cost[:32], atol=0.3)
    assert float(values[32:].mean()) < -7.0, "-1 in every step, gamma 0.9: -10 and the actions' cost"


def test_the_same_seed_gives_the_same_result_in_one_call_or_two():
    learner = make()
    once, twice = trained(learner, 4), learner.train(trained(learner, 2), 2)
    for one, other in zip(jax.tree.leaves(once.params), jax.tree.leaves(twice.params), strict=True):
        np.testing.assert_array_equal(one, other)


def test_nothing_is_learned_before_the_warm_up_and_all_actions_are_random():
    learner = make(warmup_episodes=1000)
    start = jax.tree.leaves(learner.init(jax.random.key(0)).params)
    state = trained(learner, 3)
    for before, after in zip(start, jax.tree.leaves(state.params), strict=True):
        np.testing.assert_array_equal(before, after)
    actions = state.replay.episodes.action[:30].reshape(-1)
    np.testing.assert_allclose(jnp.histogram(actions, 4, (-1, 1))[0] / actions.size, 0.25, atol=0.06)


def test_steps_after_a_divergence_are_not_stored_as_learnable_and_the_robot_is_named():
    state = trained(make((0.0, 0.0), diverging=True), 2)
    replay = state.replay
    lengths = replay.episodes.length[:20]
    np.testing.assert_array_equal(lengths, np.where(replay.episodes.index[:20] == 0, 2, 10))
    np.testing.assert_array_equal(state.diverged, [int((replay.episodes.index[:20] == 0).sum()), 0])


def test_an_episode_may_end_with_the_step_that_reaches_its_goal():
    learner = make(stop_at_success=True)
    episodes = trained(learner, 20).replay.episodes
    goal = jnp.broadcast_to(episodes.desired_goal[:, None], episodes.action.shape)
    _, success = learner.env.compute_reward(episodes.achieved_goal[:, 1:], goal, episodes.action)
    steps = jnp.where(jnp.any(success, axis=1), jnp.argmax(success, axis=1) + 1, learner.env.episode_length)
    np.testing.assert_array_equal(episodes.length, steps)
    assert 20 < int(jnp.sum(steps < learner.env.episode_length)) < 180


def test_a_robots_failures_are_averaged_over_its_episodes(monkeypatch):
    learner = make.__wrapped__((0.0, 0.0), warmup_episodes=0, exploration_noise=0.0, random_action_probability=0.0)

    def go_there_if_it_is_to_the_left(learned, index, obs, goal):
        return jnp.where(goal[:, :1] < 0.0, goal - obs, 0.0)

    monkeypatch.setattr(learner._explorer, "_policy", go_there_if_it_is_to_the_left)
    state = trained(learner, 1)
    episodes = jax.tree.map(lambda leaf: leaf[:10], state.replay.episodes)
    goal = jnp.broadcast_to(episodes.desired_goal[:, None], episodes.action.shape)
    success = learner.env.compute_reward(episodes.achieved_goal[:, 1:], goal, episodes.action)[1].any(axis=1)
    assert 0 < int(success.sum()) < 10
    expected = [1.0 - 0.2 * float((success & (episodes.index == robot)).sum()) for robot in range(2)]
    np.testing.assert_allclose(state.failure, expected, atol=1e-6)


def test_returns_are_of_more_steps_from_the_asked_share_of_the_run_on(monkeypatch):
    learner = make.__wrapped__(n_step=3, n_step_from=0.5, updates_per_iteration=1)
    state, draw, used = trained(make(), 1), learner._draw, []

    def record(*arguments):
        used.append(int(arguments[-1]))
        return draw(*arguments)

    monkeypatch.setattr(learner, "_draw", record)
    for iteration, expected in ((20, {1}), (21, {3})):
        used.clear()
        learner._learn(state.replace(iteration=jnp.int32(iteration)), jax.random.key(0))
        assert set(used) == expected


def test_the_target_takes_the_smaller_value_of_two_critics():
    learner = make(double_critic=True, warmup_episodes=1000)
    state = trained(learner, 2)
    sample = sample_steps(state.replay, jax.random.key(1), 64)

    def loss(*values: float) -> float:
        """The critics' loss where the target's are these numbers, whatever they see."""
        critic = jax.tree.map(jnp.zeros_like, state.target_params["critic"])
        critic["params"]["output"]["bias"] = jnp.asarray(values)[:, None]
        target, missed = state.target_params | {"critic": critic}, sample.achieved_goal[:, 0] + 9.0
        _, metrics = learner._loss(state.params, target, state.statistics, sample, missed)
        return float(metrics["critic_loss"])

    assert loss(-1.0, 5.0) == loss(5.0, -1.0) == loss(-1.0, -1.0)
    assert abs(loss(-1.0, 5.0) - loss(5.0, 5.0)) > 1.0


def test_what_the_actor_says_of_a_missing_joint_changes_nothing(monkeypatch):
    learner = make.__wrapped__(warmup_episodes=1000)
    monkeypatch.setattr(learner.env, "action_mask", lambda index: jnp.broadcast_to(jnp.asarray([1.0, 0.0]), (*index.shape, 2)))
    state = trained(learner, 2)
    sample = sample_steps(state.replay, jax.random.key(1), 64)

    def loss(bias: jax.Array) -> jax.Array:
        """Both losses with `bias` [2] added to what actor and target actor say."""
        shifted = [jax.tree.map(jnp.copy, params["actor"]) for params in (state.params, state.target_params)]
        for actor in shifted:
            actor["params"]["output"]["bias"] += bias
        params, target = (old | {"actor": new} for old, new in zip((state.params, state.target_params), shifted, strict=True))
        return learner._loss(params, target, state.statistics, sample, sample.achieved_goal[:, 0] + 1.0)[0]

    here, missing = jnp.asarray([0.5, 0.0]), jnp.asarray([0.0, 0.5])
    assert loss(missing) == loss(jnp.zeros(2)) != loss(here)


def test_the_policy_is_a_running_mean_of_the_actors():
    plain = trained(make(), 3)
    before, after = (trained(make(actor_average=0.75), number) for number in (3, 4))
    jax.tree.map(np.testing.assert_array_equal, plain.average_actor, before.params["actor"])
    expected = jax.tree.map(lambda mean, actor: 0.75 * mean + 0.25 * actor, before.average_actor, after.params["actor"])
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-6), after.average_actor, expected)
    played, _ = make().policy(after)
    jax.tree.map(np.testing.assert_array_equal, played["actor"], after.average_actor)


def test_an_input_that_never_varied_in_training_is_not_seen_by_the_networks():
    learner = make(normalize_inputs=True)
    inputs = jax.random.normal(jax.random.key(0), (500, learner.conditioning.size)).at[:, 0].set(0.3)
    statistics = running_statistics.update(learner.init(jax.random.key(0)).statistics, inputs)
    seen, of_another_robot = (learner.normalize(x, statistics) for x in (inputs, inputs.at[:, 0].set(0.4)))
    np.testing.assert_array_equal(seen, of_another_robot)
    np.testing.assert_allclose(seen[:, 1:].std(axis=0), 1.0, atol=0.1)


@pytest.mark.parametrize("same_goal", [False, True])
def test_goals_of_hindsight_are_scaled_and_not_cut_where_those_played_vary_less(same_goal):
    learner = make(normalize_inputs=True, same_goal=same_goal)
    state = trained(learner)
    episodes = state.replay.episodes
    goals = episodes.achieved_goal.reshape(-1, 2)
    seen = learner.normalize(jnp.concatenate([goals, goals], axis=1), state.statistics)[:, 2:]
    assert float(jnp.abs(seen).max()) < 5.0
    assert float(seen.std(axis=0).min()) > 0.2
    assert success_rate(learner, state) > 0.9


@pytest.mark.parametrize(
    "changes",
    [
        {"future_k": -1},
        {"relabel": "past"},
        {"buffer_episodes": 0},
        {"gamma": 1.5},
        {"actor_average": 1.0},
        {"hidden_sizes": (8,)},
    ],
)
def test_settings_out_of_range_name_themselves(changes):
    with pytest.raises(ConfigError, match=f"ddpg.{next(iter(changes))}="):
        DDPGConfig(**changes)

import warnings

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from hcp_jax import gym, presets
from hcp_jax.config import ArmPoolConfig, ConfigError, HopperConfig, HopperPoolConfig

NUM_ENVS = 6
HOPPER = presets.hopper(
    "a",
    "kinematics",
    pool=HopperPoolConfig(num_robots=4, num_heldout=3),
    env=HopperConfig(episode_length=5, integrator="euler"),
)
REACHER = presets.arm("a", "reacher", "chain_fk", num_envs=NUM_ENVS, pool=ArmPoolConfig(("A", "I"), ("H",), 2, 2))
CONFIGS = {"hopper": HOPPER, "reacher": REACHER}


@pytest.fixture(scope="module", params=CONFIGS)
def single(request) -> gym.SingleEnv:
    return gym.make_env(CONFIGS[request.param])


@pytest.fixture(scope="module")
def hoppers() -> gym.PoolVectorEnv:
    return gym.make_vector_env(HOPPER, NUM_ENVS)


@pytest.fixture(scope="module")
def arms() -> gym.GoalVectorEnv:
    return gym.make_vector_env(REACHER)


def test_gymnasiums_own_checker_finds_nothing(single):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(spec|infinity|Box observation|render).*")
        check_env(single, skip_render_check=True)


def test_the_same_seed_gives_the_same_episodes_and_another_does_not(hoppers):
    def play(seed):
        obs, infos = hoppers.reset(seed=seed)
        return obs, infos["robot_id"], hoppers.step(np.full((NUM_ENVS, 3), 0.5))[0]

    first, again, other = play(1), play(1), play(2)
    for one, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, same)
    assert not np.array_equal(first[0], other[0])


def test_observations_hold_each_worlds_own_v_h(hoppers):
    obs, infos = hoppers.reset(seed=0)
    assert obs.shape == (NUM_ENVS, 11 + 4)
    by_robot = {robot: obs[infos["robot_id"] == robot, 11:] for robot in np.unique(infos["robot_id"])}
    assert len(by_robot) == 4
    assert all((rows == rows[0]).all() for rows in by_robot.values())
    assert len({rows[0].tobytes() for rows in by_robot.values()}) == 4


def test_a_world_that_ends_restarts_and_shows_its_last_observation(hoppers):
    hoppers.reset(seed=0)
    for _ in range(4):
        *_, truncated, _ = hoppers.step(np.zeros((NUM_ENVS, 3)))
        assert not truncated.any()
    obs, _, terminated, truncated, infos = hoppers.step(np.zeros((NUM_ENVS, 3)))
    assert (truncated | terminated).all()
    assert infos["_final_obs"].all()
    last = np.stack(list(infos["final_obs"]))
    assert last.shape == obs.shape
    assert (np.abs(last - obs)[:, :11].max(axis=1) > 1e-3).all()


def test_rewards_for_another_goal_are_those_of_the_task(arms):
    arms.reset(seed=0)
    obs, reward, _, _, infos = arms.step(np.full((NUM_ENVS, 7), 0.5))
    again = arms.compute_reward(obs["achieved_goal"], obs["desired_goal"], infos)
    np.testing.assert_allclose(again, reward, atol=1e-6)
    rows = [{"action": action} for action in infos["action"]]
    hit = arms.compute_reward(obs["achieved_goal"], obs["achieved_goal"], rows)
    np.testing.assert_allclose(hit - reward, 2.0, atol=1e-6)


def put_at_goal(arms, row: int, speed: float = 0.0) -> None:
    """Moves a world's goal to where its point of interest is, and sets its joints' velocities [rad/s]."""
    goal = arms._state.goal
    physics = goal.physics.replace(qvel=goal.physics.qvel.at[row].set(speed))
    desired_goal = goal.desired_goal.at[row].set(goal.achieved_goal[row])
    arms._state = arms._state.replace(goal=goal.replace(physics=physics, desired_goal=desired_goal))


def test_a_diverged_world_ends_and_has_not_succeeded_though_it_stands_at_its_goal(arms):
    arms.reset(seed=0)
    put_at_goal(arms, 2, speed=1e12)
    *_, terminated, _, infos = arms.step(np.zeros((NUM_ENVS, 7)))
    assert terminated[2]
    assert not infos["is_success"][2]


def test_an_episode_ends_at_success_and_otherwise_with_its_time(arms):
    arms.reset(seed=3)
    lengths = np.zeros(NUM_ENVS, int)
    ended, num_successes = [], 0
    for step in range(201):
        if step == 100:
            put_at_goal(arms, 1)
        *_, terminated, truncated, infos = arms.step(np.zeros((NUM_ENVS, 7)))
        num_successes += infos["is_success"].sum()
        lengths += 1
        np.testing.assert_array_equal(terminated, infos["is_success"])
        ended += lengths[truncated].tolist()
        assert (lengths[truncated] == 200).all()
        lengths[terminated | truncated] = 0
    assert ended
    assert num_successes


def test_held_out_worlds_are_of_other_robots_and_of_the_types_left_out():
    trained, heldout = (gym.make_vector_env(REACHER, 64, heldout=flag) for flag in (False, True))
    ids = [set(worlds.reset(seed=0)[1]["robot_id"].tolist()) for worlds in (trained, heldout)]
    assert not ids[0] & ids[1]
    assert len(ids[1]) == 6


def test_a_learned_v_h_is_refused():
    with pytest.raises(ConfigError, match="encoding=embedding"):
        gym.make_vector_env(presets.hopper("a", "embedding"))

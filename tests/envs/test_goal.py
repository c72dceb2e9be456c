import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares

from hcp_jax.envs.arm import HOLE, REACHER_GOALS, ArmTask
from hcp_jax.envs.goal import MAX_SPEED, GoalEnv
from hcp_jax.hardware.approach_poses import MAX_HEIGHT, add_approach_poses
from hcp_jax.hardware.arm import arm_spec
from hcp_jax.hardware.arm_pool import CHAIN_TEMPLATES, make_arm_pool, make_chain_pool
from hcp_jax.hardware.chain import read_chain
from hcp_jax.hardware.ranges import ArmRanges
from hcp_jax.physics.build import make_physics


def make_env(task: ArmTask, types: str = "AI", num_per_type: int = 2) -> GoalEnv:
    pool = make_arm_pool(task.name, ArmRanges(), types, num_per_type, seed=4)
    if task.approach_starts:
        pool = add_approach_poses(pool, np.asarray(HOLE), task.random_hole, seed=4)
    return GoalEnv(task, pool, make_physics("native", pool, task.sim_dt, task.integrator))


@pytest.fixture(scope="module")
def reacher() -> GoalEnv:
    return make_env(ArmTask("reacher"))


def play(env: GoalEnv, key, actions):
    state = env.reset(key, jnp.arange(env.num_robots))
    return state, *env.step(state, actions)


def test_a_reward_is_1_within_2_cm_and_minus_1_elsewhere_less_the_action():
    task = ArmTask("reacher")
    goal = jnp.zeros((2, 3))
    achieved = jnp.array([[0.019, 0.0, 0.0], [0.0, 0.0, 0.021]])
    reward, success = task.compute_reward(achieved, goal, jnp.full((2, 7), 0.5).at[:, 5:].set(0.0))
    np.testing.assert_allclose(reward, [1.0 - 0.125, -1.0 - 0.125])
    np.testing.assert_array_equal(success, [True, False])


def test_goals_fill_the_papers_boxes(key):
    goals = ArmTask("reacher").sample_goal(key, 2000)
    np.testing.assert_allclose(goals.min(0), REACHER_GOALS[0], atol=0.01)
    np.testing.assert_allclose(goals.max(0), REACHER_GOALS[1], atol=0.01)
    assert abs(np.corrcoef(np.asarray(goals).T)[0, 1]) < 0.1, "not the box's diagonal"
    np.testing.assert_allclose(ArmTask("peg_insertion").sample_goal(key, 3), np.tile(HOLE, (3, 1)), rtol=1e-6)
    holes = ArmTask("peg_insertion", random_hole=0.2).sample_goal(key, 2000)
    np.testing.assert_allclose(holes.max(0) - holes.min(0), 0.2, atol=0.01)


def test_the_asked_share_of_episodes_starts_with_the_peg_upright_above_its_hole(key):
    env = make_env(ArmTask("peg_insertion", random_hole=0.1, approach_starts=0.25), "I", 3)
    state = env.reset(key, jnp.tile(jnp.arange(3), 200))
    lift = np.asarray(state.achieved_goal - state.desired_goal)
    started_near = np.linalg.norm(lift[:, :2], axis=1) < 0.006
    # How many poses are found hangs on the one above the hole that the others are searched from.
    has_pose = np.any(env.pool.hardware["approach_angles"], axis=-1).mean()
    assert has_pose > 0.5
    assert abs(started_near.mean() - 0.25 * has_pose) < 0.05
    assert -0.006 < lift[started_near, 2].min() < 0.02
    assert 0.08 < lift[started_near, 2].max() < MAX_HEIGHT + 0.006
    np.testing.assert_allclose(state.physics.mocap_pos[:, 0, :2], state.desired_goal[:, :2], atol=1e-6)
    np.testing.assert_array_equal(state.physics.qpos[~started_near], 0.0)


def test_the_table_stands_around_the_goal(key):
    env = make_env(ArmTask("peg_insertion", random_hole=0.2), "I", 3)
    state = env.reset(key, jnp.arange(3))
    model, data = env.pool.template_model(), mujoco.MjData(env.pool.template_model())
    for row in range(3):
        data.mocap_pos[:] = state.physics.mocap_pos[row]
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("target").xpos, state.desired_goal[row], atol=1e-6)


def test_noise_is_on_the_observation_alone(reacher, key):
    state, after, _ = play(reacher, key, jnp.zeros((4, 7)))
    for s in (state, after):
        true = jnp.concatenate([s.physics.qpos, s.physics.qvel], axis=-1)
        error = (s.obs - true)[2:]  # type I has all joints
        assert 0.0 < jnp.abs(error).max() <= 0.02
    quiet = make_env(ArmTask("reacher", observation_noise=0.0))
    _, same, _ = play(quiet, key, jnp.zeros((4, 7)))
    np.testing.assert_array_equal(same.physics.qpos, after.physics.qpos)


def test_a_joint_that_spins_off_is_observed_at_the_highest_speed(reacher, key):
    state = reacher.reset(key, jnp.arange(reacher.num_robots))
    spinning = state.replace(physics=state.physics.replace(qvel=jnp.full_like(state.physics.qvel, 1e7)))
    after, _ = reacher.step(spinning, jnp.zeros((reacher.num_robots, 7)))
    assert jnp.abs(after.physics.qvel).max() > 10 * MAX_SPEED
    assert jnp.abs(after.obs[:, 7:]).max() <= MAX_SPEED + reacher.task.observation_noise


def test_an_episode_goes_on_after_success(reacher, key):
    state = reacher.reset(key, jnp.arange(4))
    state = state.replace(desired_goal=state.achieved_goal)
    there, transition = reacher.step(state, jnp.zeros((4, 7)))
    assert transition.success.all()
    after, _ = reacher.step(there, jnp.ones((4, 7)))
    assert 0.0 < np.abs(after.physics.qpos - there.physics.qpos).max() < 0.5
    for name in ("index", "desired_goal"):
        np.testing.assert_array_equal(getattr(after, name), getattr(state, name))


class BrokenPhysics:
    """An engine that loses world 2."""

    def __init__(self, physics):
        self._physics = physics

    def step(self, *arguments):
        state, overflow = self._physics.step(*arguments)
        return state.replace(qvel=state.qvel.at[2, 1].set(jnp.nan)), overflow


def test_a_world_that_diverges_stays_where_it_was_last_plausible_and_says_so(reacher, key):
    env = GoalEnv(reacher.task, reacher.pool, BrokenPhysics(reacher.physics))
    state, after, transition = play(env, key, jnp.full((4, 7), 0.3))
    assert transition.diverged.tolist() == [row == 2 for row in range(4)]
    for name in ("qpos", "qvel"):
        moved = np.any(getattr(after.physics, name) != getattr(state.physics, name), axis=-1)
        assert moved.tolist() == [row != 2 for row in range(4)]
    np.testing.assert_array_equal(after.achieved_goal[2], state.achieved_goal[2])
    assert np.isfinite(after.obs).all()
    assert np.isfinite(transition.reward).all()


def test_missing_joints_are_0_and_their_actions_cost_and_do_nothing(reacher, key):
    action = jnp.zeros((4, 7)).at[:, 5:].set(1.0)
    _, idle, idle_transition = play(reacher, key, jnp.zeros((4, 7)))
    _, moved, transition = play(reacher, key, action)
    np.testing.assert_array_equal(moved.obs[:2].reshape(2, 2, 7)[..., 5:], 0.0)
    np.testing.assert_array_equal(transition.reward[:2], idle_transition.reward[:2])
    np.testing.assert_array_equal(moved.physics.qpos[:2], idle.physics.qpos[:2])
    assert np.abs(moved.physics.qpos[2:] - idle.physics.qpos[2:]).max() > 0
    np.testing.assert_allclose(transition.reward[2:], -1.2)


def test_aligned_joints_move_as_packed_ones_do_and_stand_at_their_types_entries(reacher, key):
    aligned = GoalEnv(dataclasses.replace(reacher.task, joint_slots="aligned"), reacher.pool, reacher.physics)
    of_type_a = [0, 1, 3, 5, 6]  # without j2 and j4
    packed = jax.random.uniform(key, (4, 7), minval=-1.0, maxval=1.0)
    spread = packed.at[:2].set(5.0).at[:2, jnp.array(of_type_a)].set(packed[:2, :5])
    _, expected, expected_transition = play(reacher, key, packed)
    _, after, transition = play(aligned, key, spread)
    np.testing.assert_array_equal(transition.action, jnp.clip(spread, -1.0, 1.0) * aligned.action_mask(jnp.arange(4)))
    np.testing.assert_array_equal(after.physics.qpos, expected.physics.qpos)
    np.testing.assert_allclose(transition.reward, expected_transition.reward, rtol=1e-6)
    for entries, joints in (
        (transition.action, expected_transition.action),
        *zip(halves(after), halves(expected), strict=True),
    ):
        np.testing.assert_array_equal(entries[:2, jnp.array(of_type_a)], joints[:2, :5])
        np.testing.assert_array_equal(entries[:2, jnp.array([2, 4])], 0.0)
        np.testing.assert_array_equal(entries[2:], joints[2:])


def halves(state) -> list:
    """Observed angles and velocities."""
    return jnp.split(state.obs, 2, axis=-1)


def test_the_achieved_goal_is_where_mujoco_has_the_point_of_interest(reacher, key):
    _, after, transition = play(reacher, key, jnp.full((4, 7), 0.3))
    for row, model in enumerate(reacher.pool.models()):
        data = mujoco.MjData(model)
        data.qpos[:] = after.physics.qpos[row]
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(after.achieved_goal[row], data.site("ref_pt").xpos, atol=1e-5)
    distance = np.linalg.norm(after.achieved_goal - after.desired_goal, axis=-1)
    np.testing.assert_allclose(transition.distance, distance, rtol=1e-6)


def test_an_arm_starts_in_one_of_the_start_poses_of_its_type(reacher, key):
    states = jax.vmap(lambda k: reacher.reset(k, jnp.arange(4)).physics.qpos)(jax.random.split(key, 20))
    poses = reacher.pool.hardware["start_angles"]
    for row in range(4):
        distance = np.abs(np.asarray(states)[:, row, None] - poses[row][None]).max(-1)
        np.testing.assert_allclose(distance.min(axis=1), 0.0, atol=1e-6)
        assert len(np.unique(distance.argmin(axis=1))) > 5


def test_one_robot_ignores_the_others_actions(reacher, key):
    _, one, _ = play(reacher, key, jnp.zeros((4, 7)))
    _, other, _ = play(reacher, key, jnp.zeros((4, 7)).at[1:].set(0.7))
    np.testing.assert_array_equal(one.physics.qpos[0], other.physics.qpos[0])


def lower_the_peg(x: float, y: float) -> np.ndarray:
    """Where the peg's bottom ends when an arm lowers it upright towards the bottom of the hole's box at (x, y)."""
    spec = arm_spec("peg_insertion", "I")
    pool = make_chain_pool(
        CHAIN_TEMPLATES["peg_insertion"], [read_chain(spec.compile())], np.zeros(1), np.zeros(1), np.zeros((1, 1, 7))
    )
    model = pool.models()[0]
    data, plan = mujoco.MjData(model), mujoco.MjData(model)
    model.opt.timestep = 1e-3
    angles, path = np.array([0.0, -0.5, 0.0, 1.0, 0.0, 1.0, 0.0]), []
    for z in np.linspace(0.15, -0.02, 18):

        def error(q, z=z):
            plan.qpos[:] = q
            mujoco.mj_kinematics(model, plan)
            return np.concatenate([plan.site("ref_pt").xpos - [x, y, z], 0.3 * (plan.site("ref_pt").xmat[[2, 5]])])

        angles = least_squares(error, np.clip(angles, *(0.99 * model.jnt_range.T)), bounds=model.jnt_range.T).x
        assert np.abs(error(angles)).max() < 5e-3
        path.append(angles)
    data.qpos[:] = path[0]
    for target in path:
        for _ in range(300):
            mujoco.mj_forward(model, data)
            torque = 400 * (target - data.qpos) - 40 * data.qvel + data.qfrc_bias
            data.ctrl[:] = np.clip(torque / model.actuator_gear[:, 0], -1, 1)
            mujoco.mj_step(model, data)
    return data.site("ref_pt").xpos.copy()


def test_the_peg_goes_into_the_hole_and_not_through_the_table():
    inside = lower_the_peg(*HOLE[:2])
    assert np.linalg.norm(inside - HOLE) < 0.03
    assert inside[2] < 0.02, "0.03 m below the table top"
    beside = lower_the_peg(HOLE[0] + 0.06, HOLE[1])
    assert beside[2] > 0.035, "on the table top, at 0.05"

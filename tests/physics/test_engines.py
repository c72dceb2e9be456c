"""All engines against C MuJoCo stepping each robot's own model."""

import jax
import jax.numpy as jnp
import mujoco
import mujoco.batch
import numpy as np
import pytest

from hcp_jax.envs.hopper import Hopper
from hcp_jax.hardware.pool import MEAN_INERTIA, RobotPool
from hcp_jax.physics.base import PhysicsState, is_plausible
from hcp_jax.physics.build import make_physics
from hcp_jax.physics.mjx import MjxPhysics
from hcp_jax.physics.native import get_batch_fields

SIM_DT, NUM_SUBSTEPS, NUM_CONTROLS = 0.002, 4, 25
ENGINES = ("native", "mjx-warp", "mjx-jax")


@pytest.fixture(scope="module")
def initial(pool) -> PhysicsState:
    """Initial states that fall in different directions within the 100 steps."""
    state = Hopper().sample_initial(pool, jax.random.key(3))
    rng = np.random.default_rng(0)
    velocity = state.qvel + jnp.asarray(rng.normal(size=state.qvel.shape) * [0.5, 1.0, 1.5, 1, 1, 1], jnp.float32)
    return state.replace(qvel=velocity)


@pytest.fixture(scope="module")
def controls(pool) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (NUM_CONTROLS, pool.num_robots, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def oracle(pool, initial, controls) -> np.ndarray:
    """qpos [N, 6] after 100 steps of C MuJoCo with Euler, and the number of robots that touched the floor."""
    final, touched = [], 0
    for robot, model in enumerate(pool.models()):
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        model.opt.timestep = SIM_DT
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = initial.qpos[robot], initial.qvel[robot]
        contact = False
        for ctrl in controls[:, robot]:
            data.ctrl[:] = ctrl
            mujoco.mj_step(model, data, nstep=NUM_SUBSTEPS)
            contact |= data.ncon > 0
        touched += contact
        final.append(data.qpos.copy())
    assert touched > pool.num_robots / 2, "the comparison must contain contacts"
    return np.asarray(final)


def rollout(physics, pool: RobotPool, initial: PhysicsState, controls: np.ndarray) -> np.ndarray:
    robots = pool.take(np.arange(pool.num_robots))

    @jax.jit
    def run(state, controls):
        def step(state, ctrl):
            return physics.step(robots, state, ctrl, NUM_SUBSTEPS)

        return jax.lax.scan(step, state, controls)

    state, overflow = run(initial, jnp.asarray(controls))
    assert int(overflow.sum()) == 0
    return np.asarray(state.qpos)


@pytest.fixture(scope="module")
def final_qpos(pool, initial, controls) -> dict[str, np.ndarray]:
    return {name: rollout(make_physics(name, pool, SIM_DT, "euler"), pool, initial, controls) for name in ENGINES}


def test_a_native_world_has_every_field_of_its_robot_and_its_solver_stops_as_its_own_model_does(pool):
    template = pool.template_model()
    batch = mujoco.batch.Batch(template, pool.num_robots)
    for name, values in get_batch_fields(pool, template).items():
        batch.expand(name)[:] = values
    for robot, model in enumerate(pool.models()):
        world = batch.get_model(robot)
        for name in pool.fields:
            if name != MEAN_INERTIA:
                np.testing.assert_array_equal(getattr(world, name), getattr(model, name), err_msg=name)
        stops_at = model.opt.tolerance * model.stat.meaninertia
        np.testing.assert_allclose(world.opt.tolerance * world.stat.meaninertia, stops_at, rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_every_engine_agrees_with_c_mujoco_after_100_steps(engine, final_qpos, oracle):
    error = np.abs(final_qpos[engine] - oracle)
    assert np.median(error) < 1e-5
    assert np.percentile(error, 99) < 1e-3


@pytest.mark.parametrize("engine", ENGINES)
def test_shuffling_the_other_rows_changes_nothing_in_a_row(engine, final_qpos, pool, initial, controls):
    order = np.concatenate([[0], 1 + np.random.default_rng(2).permutation(pool.num_robots - 1)])
    shuffled_initial = jax.tree.map(lambda leaf: leaf[order], initial)
    physics = make_physics(engine, pool, SIM_DT, "euler")
    shuffled = rollout(physics, pool.subset(order), shuffled_initial, controls[:, order])
    tolerance = 0.0 if engine == "native" else 1e-6
    np.testing.assert_allclose(shuffled[0], final_qpos[engine][0], rtol=0, atol=tolerance)


def test_native_steps_each_robot_exactly_as_it_would_alone(pool, initial, controls, final_qpos):
    alone = pool.subset([5])
    physics = make_physics("native", alone, SIM_DT, "euler")
    qpos = rollout(physics, alone, jax.tree.map(lambda leaf: leaf[5:6], initial), controls[:, 5:6])
    np.testing.assert_array_equal(qpos[0], final_qpos["native"][5])


def test_native_takes_the_integrator_from_its_name(pool, initial, controls, final_qpos):
    rk4 = rollout(make_physics("native-rk4", pool, SIM_DT, "euler"), pool, initial, controls)
    assert 1e-5 < np.median(np.abs(rk4 - final_qpos["native"])) < 0.1


def test_warp_reports_an_overflow_of_its_contact_buffer(pool, initial):
    physics = MjxPhysics(pool, SIM_DT, "euler", impl="warp", max_contacts=0, max_constraints=4)
    robots = pool.take(np.arange(pool.num_robots))
    standing = initial.replace(qpos=initial.qpos.at[:, 1].set(1.2), qvel=jnp.zeros_like(initial.qvel))
    _, overflow = jax.jit(lambda s, c: physics.step(robots, s, c, 1))(standing, jnp.zeros((pool.num_robots, 3)))
    assert int(overflow) > 0


def test_speeds_that_no_robot_reaches_are_not_plausible_though_finite(initial):
    fast = initial.replace(qvel=initial.qvel.at[7, 2].set(2e3).at[5, 0].set(500.0))
    assert np.flatnonzero(~np.asarray(is_plausible(fast))).tolist() == [7]


def test_native_marks_diverged_worlds_and_only_those(pool, initial):
    physics = make_physics("native", pool, SIM_DT, "euler")
    robots = pool.take(np.arange(pool.num_robots))
    broken = initial.replace(qvel=initial.qvel.at[7, 2].set(1e12))
    state, overflow = physics.step(robots, broken, jnp.zeros((pool.num_robots, 3)), NUM_SUBSTEPS)
    assert np.flatnonzero(~np.asarray(is_plausible(state))).tolist() == [7]
    assert int(overflow) == 0


def test_a_diverged_world_neither_prints_nor_logs_a_warning_of_mujoco(pool, initial, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    physics = make_physics("native", pool, SIM_DT, "euler")
    robots = pool.take(np.arange(pool.num_robots))
    broken = initial.replace(qvel=initial.qvel.at[7, 2].set(1e12))
    for _ in range(2):
        state, _ = physics.step(robots, broken, jnp.zeros((pool.num_robots, 3)), NUM_SUBSTEPS)
        assert not bool(is_plausible(state)[7])
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_engine_or_integrator_is_refused(pool):
    with pytest.raises(ValueError, match="physics='bullet'"):
        make_physics("bullet", pool, SIM_DT, "euler")
    with pytest.raises(ValueError, match="integrator='heun'"):
        make_physics("native", pool, SIM_DT, "heun")

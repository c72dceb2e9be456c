import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.deployment.robot_policy import make_robot_policy
from hcp_jax.experiment.arm import make_evaluator
from hcp_jax.experiment.build import make_experiment
from hcp_jax.experiment.chosen_robots import choose_robot


def test_a_policy_with_aligned_joints_moves_the_joints_that_evaluation_moves(tiny_arms, key):
    config = dataclasses.replace(
        tiny_arms, env=dataclasses.replace(tiny_arms.env, joint_slots="aligned", observation_noise=0.0)
    )
    run = make_experiment(config, "native")
    state = run.learner.init(key)
    state = state.replace(average_actor=jax.tree.map(lambda leaf: leaf + 0.1, state.average_actor))
    robot = choose_robot(run, "H:1")
    evaluator = make_evaluator(config, run.learner, run.make_env, robot.pool, run.train_pool)
    world = evaluator.env.reset(key, jnp.zeros(1, jnp.int32))
    world, _ = evaluator.env.step(world, jnp.linspace(-1.0, 1.0, 7)[None])  # so that joints differ in speed
    entries = evaluator.step(run.learner.policy(state), world)[1].action[0]
    policy = make_robot_policy(run, state, robot)
    sensed = [world.physics.qpos[0, :6], world.physics.qvel[0, :6], world.desired_goal[0]]
    of_type_h = np.array([0, 1, 2, 3, 4, 6])  # without j5
    np.testing.assert_allclose(policy.function(jnp.concatenate(sensed)) / policy.torque_limit, entries[of_type_h], atol=1e-5)
    assert np.ptp(entries) > 0.01

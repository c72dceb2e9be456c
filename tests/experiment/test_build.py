import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.config import EmbeddingConfig
from hcp_jax.experiment import build
from hcp_jax.physics.build import default_physics


def test_the_engine_asked_for_goes_before_the_configs_and_that_before_the_machines(tiny_config, monkeypatch):
    monkeypatch.setattr(build, "make_hopper_experiment", lambda _, physics: physics)
    on_warp = dataclasses.replace(tiny_config, physics="mjx-warp")
    assert build.make_experiment(on_warp, "native-rk4") == "native-rk4"
    assert build.make_experiment(on_warp) == build.make_experiment(on_warp, "auto") == "mjx-warp"
    assert build.make_experiment(tiny_config) == default_physics()


def test_an_arm_that_was_trained_on_is_measured_with_its_own_v_h_and_a_new_one_with_the_mean(tiny_arms):
    run = build.make_experiment(dataclasses.replace(tiny_arms, encoding="embedding", embedding=EmbeddingConfig(size=3)))
    params, statistics = run.learner.policy(run.init_state())
    table, change = params["embedding"], jnp.asarray([5.0, -5.0, 5.0])
    opposed = table.at[1].add(change).at[2].add(-change)  # the mean is as before

    def distances(evaluator) -> list[np.ndarray]:
        each = ((params | {"embedding": rows}, statistics) for rows in (table, opposed))
        return [np.asarray(evaluator(policy, np.arange(4), jax.random.key(0)).final_distance) for policy in each]

    np.testing.assert_array_equal(np.not_equal(*distances(run.trained_evaluator)), [False, True, True, False])
    np.testing.assert_allclose(*distances(run.evaluator), atol=1e-5)
    metrics, line = run.evaluate(run.init_state())
    assert 0.0 <= metrics["training_robots_success"] <= 100.0
    assert "on training robots with their own v_h" in line

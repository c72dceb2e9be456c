import dataclasses

from hcp_jax.experiment import build
from hcp_jax.physics.base import default_physics


def test_the_engine_asked_for_goes_before_the_configs_and_that_before_the_machines(tiny_config, monkeypatch):
    monkeypatch.setattr(build, "make_hopper_experiment", lambda _, physics: physics)
    on_warp = dataclasses.replace(tiny_config, physics="mjx-warp")
    assert build.make_experiment(on_warp, "native-rk4") == "native-rk4"
    assert build.make_experiment(on_warp) == build.make_experiment(on_warp, "auto") == "mjx-warp"
    assert build.make_experiment(tiny_config) == default_physics()

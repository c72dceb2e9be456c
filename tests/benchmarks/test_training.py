import dataclasses

import pytest

from hcp_jax import benchmark, presets
from hcp_jax.benchmarks.training import benchmark_success, benchmark_training, samples_per_step, time_to_success
from hcp_jax.config import ArmConfig, ArmPoolConfig, DDPGConfig, HopperConfig, HopperPoolConfig, PPOConfig
from hcp_jax.errors import UserError

HOPPER = presets.hopper(
    "a",
    "kinematics",
    num_envs=8,
    pool=HopperPoolConfig(num_robots=4, num_heldout=2),
    env=HopperConfig(episode_length=20, integrator="euler"),
    ppo=PPOConfig(unroll_length=8, num_minibatches=4, num_epochs=3, hidden_sizes=(8, 8)),
)
REACHER = presets.arm(
    "a",
    "reacher",
    "chain_fk",
    num_envs=4,
    eval_every=40,
    pool=ArmPoolConfig(("I",), (), 2, 2),
    env=ArmConfig(episode_length=10),
    ddpg=DDPGConfig(
        hidden_sizes=(8, 8), batch_size=16, updates_per_iteration=5, buffer_episodes=8, warmup_episodes=4, layer_norm=True
    ),
)


def test_gradient_samples_are_epochs_of_ppo_and_drawn_steps_of_ddpg():
    assert samples_per_step(HOPPER) == 3.0
    assert samples_per_step(REACHER) == 5 * 16 / (4 * 10)


@pytest.mark.slow
def test_stable_baselines3_learns_on_our_worlds_beside_us():
    """pytest -m slow tests/benchmarks, with the extra `bench`"""
    pytest.importorskip("stable_baselines3")
    rows = list(benchmark_training(REACHER, ["hcp_jax", "sb3-her"], seconds=0.01))
    assert [row["name"] for row in rows] == ["hcp_jax", "sb3-her"]
    assert all(row["control_steps_per_s"] > 0 for row in rows)


def test_the_time_to_success_ends_with_the_target_or_the_limit():
    reached = time_to_success(REACHER, "hcp_jax", target=0.0, limit=100.0)
    assert (reached["reached"], reached["env_steps"]) == (True, 40)
    given_up = time_to_success(dataclasses.replace(REACHER, seed=1), "hcp_jax", target=101.0, limit=0.01)
    assert (given_up["reached"], given_up["env_steps"]) == (False, 40)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (
            ["train", "--to-success", "90", "--rows", "sb3-ppo"],
            "--rows=sb3-ppo: expected of train --to-success: hcp_jax, sb3-her",
        ),
        (["learner", "--to-success", "90"], "--to-success: goes with train, not learner"),
        (["train", "--rows", "brax-ppo"], "--rows=brax-ppo: expected of train: hcp_jax, sb3-her"),
    ],
)
def test_rows_that_do_not_go_with_what_is_measured_are_refused(arguments, expected, capsys):
    with pytest.raises(SystemExit) as exit_info:
        benchmark.main(arguments)
    assert exit_info.value.code == 2
    assert expected in capsys.readouterr().err


def test_a_peer_that_is_missing_is_said_before_anything_is_timed(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match="--rows sb3-her: needs the extra bench"):
        next(benchmark_success(REACHER, ["hcp_jax", "sb3-her"], target=0.0, limit=1.0))


def test_the_hopper_has_no_success(tmp_path, capsys):
    (tmp_path / "experiment.py").write_text(
        "from hcp_jax import presets\ndef get_config():\n    return presets.hopper('a', 'none')\n"
    )
    with pytest.raises(SystemExit) as exit_info:
        benchmark.main(["train", "--config", str(tmp_path / "experiment.py"), "--to-success", "50"])
    assert exit_info.value.code == 2
    assert "--to-success: the hopper has no success" in capsys.readouterr().err

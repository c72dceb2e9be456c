import json

import pytest

from hcp_jax import benchmark


@pytest.mark.parametrize(
    ("experiment", "sizes"),
    [
        (
            "presets.arm('a', 'reacher', 'chain_fk', num_envs=4, pool=ArmPoolConfig(('I',), (), 2))",
            [  # in batches so small that a CPU gives them one thread
                "--config.ddpg.updates_per_iteration=20",
                "--config.ddpg.batch_size=128",
                "--config.env.episode_length=10",
                "--config.ddpg.buffer_episodes=8",
            ],
        ),
        pytest.param(
            "presets.hopper('a', 'kinematics', num_envs=8, pool=HopperPoolConfig(num_robots=4))",
            ["--config.ppo.unroll_length=8", "--config.ppo.num_minibatches=4"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_an_iteration_and_its_parts_are_timed(experiment, sizes, tmp_path):
    (tmp_path / "experiment.py").write_text(
        "from hcp_jax import presets\nfrom hcp_jax.config import ArmPoolConfig, HopperPoolConfig\n"
        f"def get_config():\n    return {experiment}\n"
    )
    arguments = ["--config", str(tmp_path / "experiment.py"), "--seconds", "0.01", "--json", str(tmp_path / "out.json")]
    benchmark.main(["learner", *arguments, *sizes])
    timed = {row["name"]: row for row in json.loads((tmp_path / "out.json").read_text())["rows"]}
    assert list(timed) == ["iteration", "collect", "update", "matmul"]
    assert all(row["seconds"] > 0 for row in timed.values())
    assert timed["update"]["flops"] == timed["matmul"]["flops"] > 0
    if "ddpg" in sizes[0]:
        assert timed["collect"]["seconds"] + 19 * timed["update"]["seconds"] == pytest.approx(
            timed["iteration"]["seconds"], rel=0.1
        )
        assert timed["update"]["replay_bytes"] == 8 * 4 * (11 * (14 + 3) + 10 * 7 + 3 + 1 + 1)

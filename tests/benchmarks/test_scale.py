import json

import pytest

from hcp_jax import benchmark

CONFIGS = {
    "hopper": "presets.hopper('a', 'kinematics')",
    "arms": "presets.arm('a', 'reacher', 'chain_fk', pool=ArmPoolConfig(('A', 'I'), ()))",
}


@pytest.mark.parametrize("robots", CONFIGS)
def test_pools_of_every_size_are_built_and_stepped(robots, tmp_path):
    experiment, out = tmp_path / "experiment.py", tmp_path / "scale.json"
    imports = "from hcp_jax import presets\nfrom hcp_jax.config import ArmPoolConfig\n"
    experiment.write_text(f"{imports}def get_config():\n    return {CONFIGS[robots]}\n")
    benchmark.main(["scale", "--config", str(experiment), "--sizes", "2", "4", "--seconds", "0.01", "--json", str(out)])
    small, large = json.loads(out.read_text())["rows"]
    assert (small["num_robots"], large["num_robots"]) == (2, 4)
    assert large["pool_bytes"] == 2 * small["pool_bytes"]
    assert large["microseconds_per_robot"] == pytest.approx(1e6 * large["seconds_per_control_step"] / 4, rel=0.01)

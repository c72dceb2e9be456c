import jax
import mujoco
import numpy as np
import pytest

from hcp_jax.hardware.arm_pool import make_arm_pool
from hcp_jax.hardware.hopper import compile_models, make_hopper_pool
from hcp_jax.hardware.pool import PoolError, RobotPool, concatenate_pools, stack_models
from hcp_jax.hardware.ranges import ArmRanges, HopperRanges


def test_rebuilt_models_equal_the_compiled_ones_in_every_array(pool):
    hardware = {name: values[:8] for name, values in pool.hardware.items()}
    compiled, rebuilt = list(compile_models(hardware)), pool.subset(np.arange(8)).models()
    for one, other in zip(compiled, rebuilt, strict=True):
        for name in dir(one):
            value = None if name.startswith("_") else getattr(one, name)
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(value, getattr(other, name), err_msg=name)
        assert one.stat.meaninertia == other.stat.meaninertia


def test_a_saved_pool_loads_equal(pool, tmp_path):
    pool.save(tmp_path / "pool")
    loaded = RobotPool.load(tmp_path / "pool")
    assert loaded.template == pool.template
    jax.tree.map(np.testing.assert_array_equal, loaded, pool)


def test_saving_never_overwrites(pool, tmp_path):
    pool.save(tmp_path / "pool")
    with pytest.raises(FileExistsError):
        pool.save(tmp_path / "pool")


def test_a_damaged_pool_is_refused(pool, tmp_path):
    pool.save(tmp_path / "pool")
    data = bytearray((tmp_path / "pool" / "pool.npz").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "pool" / "pool.npz").write_bytes(bytes(data))
    with pytest.raises(PoolError, match="damaged"):
        RobotPool.load(tmp_path / "pool")
    (tmp_path / "pool" / "pool.json").write_text("[]")
    for name in ("pool", "nowhere"):
        with pytest.raises(PoolError, match="not a robot pool"):
            RobotPool.load(tmp_path / name)


def test_variants_that_differ_in_an_unbatched_field_are_refused(pool):
    models = pool.subset([0, 1]).models()
    models[1].geom_friction[1, 0] = 0.123
    with pytest.raises(PoolError, match="geom_friction"):
        stack_models(models)


def test_take_repeats_and_reorders_robots(pool):
    taken = pool.take(np.array([5, 0, 5]))
    np.testing.assert_array_equal(taken.robot_id, [5, 0, 5])
    np.testing.assert_allclose(taken.fields["body_mass"], pool.fields["body_mass"][[5, 0, 5]], rtol=1e-6)


def test_pools_of_different_templates_do_not_mix(pool):
    other = pool.replace(template=pool.template.replace("hopper", "jumper"))
    with pytest.raises(PoolError, match="different templates"):
        concatenate_pools(pool, other)
    heldout = make_hopper_pool(HopperRanges(), 2, 0, "heldout")
    both = concatenate_pools(pool, heldout)
    assert len(set(both.robot_id.tolist())) == pool.num_robots + 2


def test_the_template_is_a_valid_model(pool):
    assert isinstance(pool.template_model(), mujoco.MjModel)


def test_pools_of_arms_with_different_numbers_of_start_poses_concatenate():
    chain, arm = (make_arm_pool("reacher", ArmRanges(), (name,), 1, seed=0) for name in ("R5", "H"))
    poses = concatenate_pools(chain, arm).hardware["start_angles"]
    few = chain.hardware["start_angles"][0]
    assert len(few) < poses.shape[1]
    np.testing.assert_array_equal(poses[0], np.resize(few, poses[0].shape))
    np.testing.assert_array_equal(poses[1], arm.hardware["start_angles"][0])

"""What a run does when something goes wrong, apart from being killed (tests/faults)."""

import dataclasses
import pathlib
import shutil

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from hcp_jax import train
from hcp_jax.algorithms.guard import apply_update, init_skipped
from hcp_jax.training import loop, run_folder
from hcp_jax.training.checkpoint import Checkpoints
from hcp_jax.training.run_folder import RunFolderError

HOPPER = pathlib.Path(__file__).resolve().parents[2] / "experiments" / "hopper_ppo.py"


@pytest.mark.parametrize(("grad", "loss"), [(jnp.nan, 1.0), (jnp.inf, 1.0), (1.0, jnp.nan)])
def test_an_update_that_is_not_finite_changes_nothing_and_is_counted_with_its_robots(grad, loss):
    optimizer, params = optax.adam(0.1), {"w": jnp.ones(2)}
    opt_state, index = optimizer.init(params), jnp.array([1, 1, 3])
    step = jax.jit(lambda grad, loss, skipped: apply_update(
        optimizer, {"w": jnp.array([1.0, grad])}, {"loss": loss}, params, opt_state, skipped, index
    ))  # fmt: skip
    new_params, new_opt_state, metrics, skipped = step(grad, loss, init_skipped(4))
    jax.tree.map(np.testing.assert_array_equal, (new_params, new_opt_state), (params, opt_state))
    assert (float(metrics["loss"]), int(skipped.total), int(skipped.in_a_row)) == (0.0, 1, 1)
    np.testing.assert_array_equal(skipped.robots, [0, 1, 0, 1])
    *_, skipped = step(1.0, 1.0, skipped)
    assert (int(skipped.total), int(skipped.in_a_row), int(skipped.longest)) == (1, 0, 1)


def test_a_finite_update_is_the_optimisers_own():
    optimizer, params, grads = optax.adam(0.1), jnp.ones(3), jnp.array([1.0, -2.0, 3.0])
    updates, _ = optimizer.update(grads, optimizer.init(params), params)
    index = jnp.zeros(1, jnp.int32)
    new, *_ = apply_update(optimizer, grads, {}, params, optimizer.init(params), init_skipped(1), index)
    np.testing.assert_array_equal(new, optax.apply_updates(params, updates))


@pytest.mark.parametrize("kind", ["hopper", "arms"])
def test_a_run_whose_updates_stay_non_finite_ends_and_names_a_robot(
    kind, finished_run, finished_arms, tiny_config, tiny_arms, tmp_path
):
    config, finished = (tiny_config, finished_run) if kind == "hopper" else (tiny_arms, finished_arms)
    config = dataclasses.replace(config, max_skipped_updates=3, total_env_steps=2 * config.total_env_steps)
    folder = tmp_path / "run"
    shutil.copytree(finished, folder)
    run = loop.make_experiment(config)
    checkpoints = Checkpoints(folder / run_folder.CHECKPOINT_FOLDER)
    iteration, state, _ = checkpoints.restore(run.init_state())
    broken = jax.tree.map(lambda leaf: jnp.full_like(leaf, jnp.nan), state.params)
    with pytest.raises(loop.NonFiniteError, match=r"robot \d+ in \d+ of them") as error:
        loop.TrainingLoop(run, folder, checkpoints, iteration).run(state.replace(params=broken), loop.Interrupt())
    kept = f"{config.total_env_steps // 2:,} steps"
    assert f"last checkpoint: {kept}" in str(error.value)
    assert checkpoints.iterations()[-1] == iteration


def test_a_second_process_on_a_run_folder_is_refused(finished_run, tiny_config, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(finished_run, folder)
    with run_folder.lock(folder), pytest.raises(RunFolderError, match=r"process \d+ is training there"):
        loop.train(dataclasses.replace(tiny_config, total_env_steps=10_000), folder, resume=True)
    with run_folder.lock(folder):
        pass  # free again


def test_a_folder_that_cannot_be_written_is_said_in_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as exit_info:
        train.main(["--config", str(HOPPER), "--out", str(tmp_path / "file" / "run"),
                    "--config.pool.num_robots=8", "--config.pool.num_heldout=2"])  # fmt: skip
    error = capsys.readouterr().err
    assert exit_info.value.code == 2
    assert "--out: " in error
    assert "cannot be written (Not a directory)" in error
    assert error.count("\n") == 1, error

import csv
import dataclasses
import json
import pathlib
import shutil
import signal

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hcp_jax import train
from hcp_jax.algorithms.identification import get_actor
from hcp_jax.config import to_dict
from hcp_jax.evaluation.summary import read_wall_seconds
from hcp_jax.training import loop, warm_start
from hcp_jax.training.checkpoint import CheckpointError, Checkpoints
from hcp_jax.training.loop import Interrupt, TrainingLoop
from hcp_jax.training.metrics import read_rows
from hcp_jax.training.policy_file import load_policy, write_policy
from hcp_jax.training.warm_start import load_init


def metrics(folder: pathlib.Path) -> list[dict]:
    with (folder / "metrics.csv").open() as file:
        return list(csv.DictReader(file))


def test_a_run_folder_holds_what_the_design_promises(finished_run):
    names = {path.name for path in finished_run.iterdir()}
    assert {"config.json", "environment.json", "metrics.csv", "timing.csv", "checkpoints", "events", "curves.png"} <= names
    environment = json.loads((finished_run / "environment.json").read_text())
    assert environment["physics"] == "native"
    assert environment["versions"]["jax"] == jax.__version__
    assert (finished_run / "curves.png").read_bytes().startswith(b"\x89PNG")


def test_there_is_one_row_per_evaluation_with_both_kinds_of_held_out_v_h(finished_run):
    rows = metrics(finished_run)
    assert [int(row["env_steps"]) for row in rows] == [128, 256, 384, 512]
    same = [float(row["heldout_fitted_return_mean"]) == float(row["heldout_return_mean"]) for row in rows]
    assert same == [True, False, False, False], "the policy sees v_h from 192 steps on"


def test_the_newest_checkpoints_and_the_best_are_kept(finished_run, tiny_config):
    rows = metrics(finished_run)
    best = 2 * (1 + int(np.argmax([float(row["train_return_mean"]) for row in rows])))
    checkpoints = Checkpoints(finished_run / "checkpoints", read_only=True)
    assert checkpoints.iterations() == [4, 6, 8]
    assert checkpoints.best() == best


def test_a_best_checkpoint_that_a_kill_prevented_is_made_up_for(finished_run, tiny_config, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    *before, last = (folder / "metrics.csv").read_text().splitlines()
    column = before[0].split(",").index("train_return_mean")
    words = last.split(",")
    words[column] = "1e9"
    (folder / "metrics.csv").write_text("\n".join([*before, ",".join(words)]) + "\n")
    for path in (folder / "checkpoints" / "best").iterdir():
        shutil.rmtree(path)
    loop.train(tiny_config, folder, resume=True)
    assert Checkpoints(folder / "checkpoints", read_only=True).best() == 8


def test_a_best_checkpoint_of_a_part_that_is_gone_gives_way_to_the_next_best(tmp_path, finished_run, tiny_config):
    state = loop.make_experiment(tiny_config).init_state()
    checkpoints = Checkpoints(tmp_path / "checkpoints")
    for iteration in (20, 15):  # the run went on from before 20
        checkpoints.save(iteration, state, is_best=True)
    checkpoints.wait()
    assert Checkpoints(tmp_path / "checkpoints", read_only=True).best() == 15


@pytest.mark.parametrize("cut", [3, *(pytest.param(cut, marks=pytest.mark.slow) for cut in (2, 5))])
def test_a_resumed_run_writes_the_same_bytes_as_an_uninterrupted_one(finished_run, tiny_config, tmp_path, monkeypatch, cut):
    """Cut after `cut` of 8 iterations: between two evaluations and at one."""
    folder = tmp_path / "run"
    run = loop.make_experiment(tiny_config)
    interrupt = Interrupt()
    checkpoints = Checkpoints(folder / "checkpoints")
    loop.run_folder.write_start(folder, tiny_config, run.physics)
    training = TrainingLoop(run, folder, checkpoints, 0)
    monkeypatch.setattr(loop, "_CHUNK_SECONDS", 0.0)
    train_step = run.learner.train

    def train_and_interrupt(state, count):
        interrupt.requested = training._iteration + count >= cut
        return train_step(state, count)

    monkeypatch.setattr(run.learner, "train", train_and_interrupt)
    assert training.run(run.init_state(), interrupt) is None
    stopped = read_rows(folder / "timing.csv")
    assert int(stopped[-1]["env_steps"]) == cut * tiny_config.steps_per_iteration
    run.fitter._fitted = None  # fits v_h again, as another process does
    loop.train(tiny_config, folder, resume=True)
    assert (folder / "metrics.csv").read_bytes() == (finished_run / "metrics.csv").read_bytes()
    seconds = [float(row["seconds"]) for row in read_rows(folder / "timing.csv")]
    assert seconds == sorted(seconds), "the clock goes on where it stopped"
    assert read_wall_seconds(folder) == seconds[-1]


def test_a_jitted_call_trains_for_some_seconds_whatever_an_iteration_takes(tiny_config, tmp_path, monkeypatch):
    clock, counts = [0.0], []
    monkeypatch.setattr(loop.time, "monotonic", lambda: clock[0])
    run = loop.make_experiment(dataclasses.replace(tiny_config, eval_every=tiny_config.total_env_steps))
    training = TrainingLoop(run, tmp_path, Checkpoints(tmp_path / "checkpoints"), 0)
    monkeypatch.setattr(training, "_evaluate", lambda state: (state, {}))
    monkeypatch.setattr(training, "_finish", lambda: None)

    def train_for(state, count):
        counts.append(count)
        clock[0] += 0.4 * loop._CHUNK_SECONDS * count if len(counts) < 4 else 10 * loop._CHUNK_SECONDS
        return state

    monkeypatch.setattr(run.learner, "train", train_for)
    training.run(run.init_state(), Interrupt())
    assert counts == [1, 2, 2, 2, 1]


def test_rows_written_after_the_last_checkpoint_are_dropped_on_resume(finished_run, tiny_config, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    shutil.rmtree(folder / "checkpoints" / "newest" / "8")
    loop.train(tiny_config, folder, resume=True)
    assert (folder / "metrics.csv").read_bytes() == (finished_run / "metrics.csv").read_bytes()


@pytest.mark.parametrize("damage", ["truncated", "emptied"])
def test_a_damaged_checkpoint_is_passed_over_with_a_line(finished_run, tiny_config, tmp_path, capsys, damage):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    for path in (folder / "checkpoints" / "newest" / "8").rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] if damage == "truncated" else b"")
    loop.train(tiny_config, folder, resume=True)
    assert "checkpoint 8 cannot be read and is passed over" in capsys.readouterr().out
    assert (folder / "metrics.csv").read_bytes() == (finished_run / "metrics.csv").read_bytes()


def test_where_no_checkpoint_can_be_read_all_stay_where_they_are(finished_run, tiny_config, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    checkpoints = sorted(path.name for path in (folder / "checkpoints" / "newest").iterdir())
    for path in (folder / "checkpoints" / "newest").rglob("*"):
        if path.is_file():
            path.write_bytes(b"")
    for _ in range(2):
        with pytest.raises(CheckpointError, match="no readable checkpoint; checkpoint 8 cannot be read"):
            loop.train(tiny_config, folder, resume=True)
    assert sorted(path.name for path in (folder / "checkpoints" / "newest").iterdir()) == checkpoints
    assert (folder / "metrics.csv").read_bytes() == (finished_run / "metrics.csv").read_bytes()


def test_a_checkpoint_damaged_again_is_moved_aside_again(finished_run, tiny_config, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    for _ in range(2):
        for path in (folder / "checkpoints" / "newest" / "8").rglob("*"):
            if path.is_file():
                path.write_bytes(b"")
        loop.train(tiny_config, folder, resume=True)
    assert {path.name for path in (folder / "checkpoints" / "damaged").iterdir()} == {"8", "8_2"}
    assert (folder / "checkpoints" / "newest" / "8").is_dir()


def test_a_damaged_best_checkpoint_is_said_in_one_line(finished_run, tiny_config, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    for path in (folder / "checkpoints" / "best").rglob("*"):
        if path.is_file():
            path.write_bytes(b"")
    with pytest.raises(CheckpointError, match=r"best checkpoint, \d, cannot be read"):
        load_policy(folder, loop.make_experiment(tiny_config), best=True)


def test_a_published_policy_has_no_best_checkpoint(tiny_arms):
    policy = pathlib.Path(__file__).resolve().parents[2] / "results" / "policies" / "reacher_hcpe_leave_h_s0"
    with pytest.raises(CheckpointError, match="is a published policy, which is one alone"):
        load_policy(policy, loop.make_experiment(tiny_arms), best=True)


def test_signals_are_what_they_were_once_training_ends(finished_run, tiny_config, tmp_path):
    before = [signal.getsignal(name) for name in (signal.SIGINT, signal.SIGTERM)]
    folder = shutil.copytree(finished_run, tmp_path / "run")
    loop.train(tiny_config, folder, resume=True)
    assert [signal.getsignal(name) for name in (signal.SIGINT, signal.SIGTERM)] == before


def test_a_run_goes_on_from_its_folder_alone_and_may_be_given_more_steps(finished_run, tmp_path, capsys):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    train.main(["--resume", "--out", str(folder), "--config.total_env_steps=640"])
    assert [int(row["env_steps"]) for row in metrics(folder)] == [128, 256, 384, 512, 640]
    assert "640 steps instead of 512: stretched over the new length: the decay of the step sizes\n" in capsys.readouterr().out
    assert loop.run_folder.read_config(folder).total_env_steps == 640
    assert loop.run_folder.find_differences(*(loop.run_folder.read_config(f) for f in (finished_run, folder))) == [
        ("total_env_steps", 512, 640)
    ]


def test_a_run_that_goes_on_has_no_picture_of_its_end(finished_run, tiny_config, tmp_path, monkeypatch):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    config = dataclasses.replace(tiny_config, total_env_steps=640)
    run = loop.make_experiment(tiny_config)
    monkeypatch.setattr(run.learner, "train", lambda state, count: state)
    interrupt = Interrupt(requested=True)
    run = dataclasses.replace(run, config=config)
    assert loop._run(run, run.init_state(), folder, resume=True, interrupt=interrupt) is None
    assert not (folder / "curves.png").exists()


def test_a_run_is_not_given_fewer_steps_than_it_has_done(finished_run, tiny_config, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    with pytest.raises(loop.run_folder.RunFolderError, match=r"total_env_steps=256: .*run is at 512 steps; expected no fewer"):
        loop.train(dataclasses.replace(tiny_config, total_env_steps=256), folder, resume=True)
    assert loop.run_folder.read_config(folder).total_env_steps == 512


def test_heldout_robots_do_not_depend_on_the_training_seed(tiny_config):
    one, other = (loop.make_experiment(dataclasses.replace(tiny_config, seed=seed)) for seed in (0, 1))
    jax.tree.map(np.testing.assert_array_equal, one.heldout_pool, other.heldout_pool)
    jax.tree.map(np.testing.assert_array_equal, one.train_pool, other.train_pool)


@pytest.fixture(scope="module")
def warm(finished_run, tiny_config):
    """A warm-started experiment on new robots, its state at the start, and the state that it starts from."""
    config = dataclasses.replace(tiny_config, init=str(finished_run), pool=dataclasses.replace(tiny_config.pool, split="new"))
    run = loop.make_experiment(config)
    return run, load_init(config)(run, run.init_state()), load_policy(finished_run, loop.make_experiment(tiny_config))[1]


def test_a_warm_start_takes_hidden_layers_and_leaves_output_layers_and_embeddings_new(warm):
    run, state, source = warm
    fresh = run.init_state().params
    policy, source_policy = state.reserve.network["policy"], source.params["network"]["params"]["policy"]
    np.testing.assert_array_equal(policy["hidden_1"]["kernel"], source_policy["hidden_1"]["kernel"])
    np.testing.assert_array_equal(policy["output"]["kernel"], fresh["network"]["params"]["policy"]["output"]["kernel"])
    assert not np.array_equal(state.params["embedding"], source.params["embedding"])
    np.testing.assert_allclose(
        state.params["embedding"] - fresh["embedding"], np.tile(source.params["embedding"].mean(axis=0), (8, 1)), atol=1e-6
    )


def test_a_warm_start_of_all_layers_takes_the_output_layers_too(finished_run, tiny_config):
    config = dataclasses.replace(tiny_config, init=str(finished_run), init_layers="all")
    run = loop.make_experiment(config)
    state, source = load_init(config)(run, run.init_state()), load_policy(finished_run, loop.make_experiment(tiny_config))[1]
    trained = get_actor(source.params, source.obs_statistics).network
    jax.tree.map(np.testing.assert_array_equal, state.reserve.network, trained)


def test_a_warm_start_identifies_its_robots_under_the_old_actor_with_the_old_forward_model(warm):
    run, state, source = warm
    jax.tree.map(np.testing.assert_array_equal, get_actor(state.params, state.obs_statistics), source.reserve)
    hidden = np.asarray(state.reserve.network["policy"]["hidden_1"]["kernel"])
    start = np.asarray(state.params["embedding"])
    state = run.learner.train(jax.tree.map(jnp.copy, state), run.learner.identify_iterations)
    models = [params["network"]["params"]["forward_model"] for params in (state.params, source.params)]
    jax.tree.map(np.testing.assert_array_equal, *models)
    np.testing.assert_array_equal(state.params["network"]["params"]["policy"]["hidden_1"]["kernel"], hidden)
    assert np.abs(np.asarray(state.params["embedding"]) - start).max() > 1e-3


def test_an_arm_run_reports_success_of_training_types_and_of_the_type_left_out(finished_arms):
    rows = metrics(finished_arms)
    assert [int(row["env_steps"]) for row in rows] == [80, 160, 240, 320]
    types = [name.removeprefix("success_") for name in rows[0] if name.startswith("success_")]
    assert types == ["A", "I", "H"]
    assert all(0.0 <= float(row["left_out_success"]) <= 100.0 for row in rows)
    assert float(rows[-1]["critic_loss"]) > 0.0


def test_a_resumed_arm_run_ends_as_the_uninterrupted_one_replay_buffer_included(finished_arms, tiny_arms, tmp_path):
    folder = tmp_path / "arms"
    loop.train(dataclasses.replace(tiny_arms, total_env_steps=160), folder)
    loop.train(tiny_arms, folder, resume=True)
    assert (folder / "metrics.csv").read_bytes() == (finished_arms / "metrics.csv").read_bytes()
    run = loop.make_experiment(tiny_arms)
    read = [Checkpoints(path / "checkpoints", read_only=True).restore(run.init_state()) for path in (folder, finished_arms)]
    one, other = (state.replay for _, state, _ in read)
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_a_resumed_run_does_not_need_the_run_that_it_started_from(finished_arms, tiny_arms, tmp_path, capsys):
    folder = shutil.copytree(finished_arms, tmp_path / "run")
    config = dataclasses.replace(tiny_arms, init=str(tmp_path / "gone"))
    (folder / "config.json").write_text(json.dumps(to_dict(config)))
    loop.train(config, folder, resume=True)
    assert "resuming at 320 steps" in capsys.readouterr().out


def test_a_policy_is_read_from_a_checkpoint_whatever_else_training_keeps(finished_arms, tiny_arms):
    larger = dataclasses.replace(tiny_arms, ddpg=dataclasses.replace(tiny_arms.ddpg, buffer_episodes=50))
    run = loop.make_experiment(larger)
    whole = Checkpoints(finished_arms / "checkpoints", read_only=True).restore(loop.make_experiment(tiny_arms).init_state())[1]
    _, state = load_policy(finished_arms, run)
    for name in state.policy_fields:
        jax.tree.map(np.testing.assert_array_equal, getattr(state, name), getattr(whole, name))
    assert state.replay.capacity == 50


def test_arms_start_from_the_layers_of_another_run(finished_arms, tiny_arms):
    config = dataclasses.replace(tiny_arms, init=str(finished_arms))
    run = loop.make_experiment(config)
    state, source = load_init(config)(run, run.init_state()), load_policy(finished_arms, run)[1]
    actor, old = (params["actor"]["params"] for params in (state.params, source.params))
    np.testing.assert_array_equal(actor["hidden_0"]["kernel"], old["hidden_0"]["kernel"])
    assert not np.array_equal(actor["output"]["kernel"], old["output"]["kernel"])
    jax.tree.map(np.testing.assert_array_equal, state.target_params["actor"], state.params["actor"])
    config = dataclasses.replace(config, init_layers="all")
    jax.tree.map(np.testing.assert_array_equal, load_init(config)(run, run.init_state()).params, source.params)


def test_an_arms_run_from_another_ones_layers_keeps_its_statistics(finished_arms, tiny_arms):
    config = dataclasses.replace(tiny_arms, init=str(finished_arms), init_layers="all")
    for started, changes in ((config, False), (tiny_arms, True)):
        run = loop.make_experiment(started)
        state = load_init(config)(run, run.init_state())
        before = np.array(state.statistics.mean)
        after = np.asarray(run.learner.train(state, 1).statistics.mean)
        assert (before != after).any() == changes


def test_arms_start_from_the_mean_of_the_actors(finished_arms, tiny_arms, monkeypatch):
    run = loop.make_experiment(tiny_arms)
    iteration, source = load_policy(finished_arms, run)
    mean = jax.tree.map(lambda leaf: leaf + 1.0, source.average_actor)
    monkeypatch.setattr(warm_start, "load_policy", lambda *_: (iteration, source.replace(average_actor=mean)))
    config = dataclasses.replace(tiny_arms, init=str(finished_arms), init_layers="all")
    state = load_init(config)(run, run.init_state())
    for actor in (state.params["actor"], state.target_params["actor"], state.average_actor):
        jax.tree.map(np.testing.assert_array_equal, actor, mean)


def test_arms_do_not_start_from_a_policy_that_was_published_without_its_critic(finished_arms, tiny_arms, tmp_path):
    shutil.copy(finished_arms / "config.json", tmp_path)
    write_policy(tmp_path, load_policy(finished_arms, loop.make_experiment(tiny_arms))[1], critic=False)
    with pytest.raises(CheckpointError, match="published without its critic"):
        load_init(dataclasses.replace(tiny_arms, init=str(tmp_path)))


def test_hoppers_do_not_start_from_a_run_that_is_still_identifying_its_robots(tiny_config, tmp_path):
    run = loop.make_experiment(tiny_config)
    loop.run_folder.write_start(tmp_path, tiny_config, run.physics)
    write_policy(tmp_path, run.init_state().replace(iteration=jnp.int32(run.learner.identify_iterations - 1)))
    with pytest.raises(CheckpointError, match="is still identifying its robots; expected a run that is past"):
        load_init(dataclasses.replace(tiny_config, init=str(tmp_path)))


def test_hoppers_do_not_start_from_an_arms_run(finished_arms, tiny_config):
    with pytest.raises(CheckpointError, match="its task is 'reacher'"):
        load_init(dataclasses.replace(tiny_config, init=str(finished_arms)))

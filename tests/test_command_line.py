"""Bad input: one line, exit code 2, nothing written."""

import dataclasses
import json
import os
import pathlib
import shutil
import signal

import jax
import pytest

from hcp_jax import benchmark, command_line, evaluate, sweep, train
from hcp_jax.config import Config, ConfigError, field_names, from_dict, to_dict
from hcp_jax.errors import PhysicsOverflowError, one_line
from hcp_jax.training import sweeping

EXPERIMENTS = pathlib.Path(__file__).resolve().parents[1] / "experiments"
HOPPER = str(EXPERIMENTS / "hopper_ppo.py")
HCPI = str(EXPERIMENTS / "hopper_embedding.py")
REACHER = str(EXPERIMENTS / "reacher_hcpe_leave_h.py")
PEG = str(EXPERIMENTS / "peg_jacobian_leave_h.py")
POLICY = EXPERIMENTS.parent / "results" / "policies" / "reacher_hcpe_leave_h_s0"
FINETUNE = str(EXPERIMENTS / "finetune.py")


@pytest.mark.parametrize("path", sorted(EXPERIMENTS.glob("*.py")), ids=lambda path: path.stem)
def test_every_experiment_builds_and_survives_json(path):
    text = path.read_text()
    configs = command_line.load_configs(str(path)) if "def get_configs" in text else [command_line.load_config(str(path))]
    for config in configs:
        assert from_dict(Config, json.loads(json.dumps(to_dict(config)))) == config


def test_overrides_are_typed_and_reach_nested_fields():
    config = command_line.load_config(
        HOPPER, ["--config.seed=3", "--config.ppo.learning_rate=1e-4", "--config.pool.ranges.damping=(0.5,1.5)"]
    )
    assert (config.seed, config.ppo.learning_rate, config.pool.ranges.damping) == (3, 1e-4, (0.5, 1.5))


def test_overrides_leave_the_original_alone():
    config = command_line.load_config(HOPPER)
    command_line.apply_overrides(config, ["--config.seed=9"])
    assert config.seed == 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.seed = 1


def experiment(folder: pathlib.Path, body: str) -> str:
    path = folder / "experiment.py"
    path.write_text(body)
    return str(path)


FEW_ROBOTS = ("--config.pool.robots_per_type=1", "--config.pool.heldout_per_type=1")
BAD_ARGUMENTS = {
    "unknown config file": (["--config", "nowhere.py"], "nowhere.py: no such file"),
    "no config": ([], "--config"),
    "unknown field": (["--config", HOPPER, "--config.ppo.learning_rat=1"], "did you mean --config.ppo.learning_rate"),
    "unknown argument": (["--config", HOPPER, "--lr=1"], "--lr=1: unknown argument"),
    "stray word": (["--config", HOPPER, "fast"], "fast: unexpected argument"),
    "wrong type": (["--config", HOPPER, "--config.ppo.learning_rate=fast"], "fast"),
    "float for int": (["--config", HOPPER, "--config.seed=1.5"], "1.5"),
    "batch that does not divide": (
        ["--config", HOPPER, "--config.ppo.num_minibatches=7"],
        "ppo.num_minibatches=7: must divide",
    ),
    "negative range": (["--config", HOPPER, "--config.pool.ranges.damping=(-1.0,2.0)"], "ranges.damping=(-1.0, 2.0)"),
    "reversed range": (["--config", HOPPER, "--config.pool.ranges.armature=(2.0,1.0)"], "low is above high"),
    "unknown encoding": (["--config", HOPPER, "--config.encoding=colour"], "encoding='colour': expected one of none"),
    "unknown physics": (["--config", HOPPER, "--config.physics=bullet"], "physics='bullet': expected one of auto"),
    "a negative seed of the pool": (
        ["--config", HOPPER, "--config.pool.seed=-1"],
        "pool.seed=-1: expected 0 to 9223372036854775807",
    ),
    "a negative seed of a pool of arms": (["--config", REACHER, "--config.pool.seed=-1"], "pool.seed=-1: expected 0 to"),
    "no robots": (["--config", HOPPER, "--config.pool.num_robots=0"], "pool.num_robots=0: expected at least 1"),
    "unknown robot type": (
        ["--config", REACHER, "--config.pool.types=('A','Q')"],
        "pool.types='Q': expected types out of A, B",
    ),
    "an arm that holds a peg": (
        ["--config", REACHER, "--config.pool.left_out=('K',)"],
        "pool.left_out='K': expected types A to I",
    ),
    "an arm that holds a peg, to train on": (
        ["--config", REACHER, "--config.pool.types=('A','K')"],
        "pool.types='K': expected types A to I",
    ),
    "a hole for the reacher": (
        ["--config", REACHER, "--config.env.random_hole=0.2"],
        "env.random_hole=0.2: expected 0 for the reacher",
    ),
    "a tip without an arm": (["--config", REACHER, "--config.robot_tip=hand"], "robot_tip='hand': expected none without robot"),
    "a base of the hopper": (
        ["--config", HOPPER, "--config.robot_base=foot"],
        "robot_base='foot': expected none for the hopper",
    ),
    "a width of actions that is none": (
        ["--config", HOPPER, "--config.ppo.initial_log_std=nan"],
        "ppo.initial_log_std=nan: expected a finite number",
    ),
    "a random chain with a peg": (
        ["--config", PEG, "--config.pool.types=('R7',)"],
        "pool.types='R7': expected types A to K for peg_insertion",
    ),
    "reversed range of random chains": (
        ["--config", REACHER, "--config.pool.chain_ranges.reach=(2.0,1.0)"],
        "chain_ranges.reach=(2.0, 1.0): low is above high",
    ),
    "buffer of less than a batch": (
        ["--config", REACHER, "--config.ddpg.buffer_episodes=100"],
        "ddpg.buffer_episodes=100: must hold",
    ),
    "buffer larger than the memory": (
        ["--config", REACHER, "--config.ddpg.buffer_episodes=1000000000", *FEW_ROBOTS],
        "ddpg.buffer_episodes=1000000000: needs 19,",
    ),
    "negative k": (["--config", REACHER, "--config.ddpg.future_k=-1"], "ddpg.future_k=-1: expected at least 0"),
    "hopper's v_h for an arm": (
        ["--config", REACHER, "--config.encoding=kinematics"],
        "encoding='kinematics': expected one of none",
    ),
    "algorithm of another task": (["--config", REACHER, "--config.algorithm=ppo"], "algorithm='ppo': expected one of ddpg"),
    "neither types nor an arm": (
        ["--config", REACHER, "--config.pool.types=()"],
        "pool.types=(): expected at least 1 type, or",
    ),
    "types beside an arm": (["--config", REACHER, "--config.robot=panda"], "expected () beside robot='panda'"),
    "a split beside an arm": (
        ["--config", FINETUNE, "--config.robot=panda", "--config.pool.split=new"],
        "pool.split='new': expected 'train' beside robot='panda'",
    ),
    "an arm for the hopper": (["--config", HOPPER, "--config.robot=panda"], "robot='panda': expected none for the hopper"),
    "an arm that is not there": (
        ["--config", FINETUNE, "--config.robot=pandas", "--config.init="],
        "pandas: no such file, and no arm of the catalogue: fetch, gen3, iiwa14, panda, sawyer, ur10e, ur5e, xarm7",
    ),
    "dynamics of one arm alone": (
        ["--config", FINETUNE, "--config.encoding=chain+dynamics"],
        "encoding='chain+dynamics': expected one of none, chain,",
    ),
    "identification by ddpg": (
        ["--config", REACHER, "--config.embedding.identify_steps=1000"],
        "embedding.identify_steps=1000: expected 0 for ddpg",
    ),
    "nothing but identification": (
        ["--config", HCPI, "--config.embedding.identify_steps=5000000"],
        "embedding.identify_steps=5000000: must leave an iteration (32000 steps) of total_env_steps=5000000",
    ),
    "more robots than ids": (
        ["--config", REACHER, "--config.pool.robots_per_type=10001"],
        "pool.robots_per_type=10001: expected at most 10000",
    ),
    "init of other layers": (
        ["--config", REACHER, f"--config.init={POLICY}", "--config.ddpg.layer_norm=False"],
        "another architecture: its ddpg.layer_norm is True, the config's False",
    ),
    "init with joints elsewhere": (
        ["--config", REACHER, f"--config.init={POLICY}", "--config.env.joint_slots=aligned"],
        "another architecture: its env.joint_slots is 'packed', the config's 'aligned'",
    ),
    "unknown places of joints": (
        ["--config", REACHER, "--config.env.joint_slots=sorted"],
        "env.joint_slots='sorted': expected one of packed, aligned",
    ),
    "missing init": (["--config", HOPPER, "--config.init=nowhere"], "nowhere: no such run folder"),
    "resume of nothing": (["--config", HOPPER, "--resume"], "no such run folder"),
    "out without config": (["--out", "a"], "required: --config"),
}


def fails(capsys, function, arguments) -> str:
    """Runs a command that must end with code 2 and one line; returns the line."""
    with pytest.raises(SystemExit) as exit_info:
        function(arguments)
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


@pytest.mark.parametrize("name", BAD_ARGUMENTS)
def test_bad_arguments_give_one_line_and_write_nothing(name, tmp_path, capsys, monkeypatch):
    arguments, expected = BAD_ARGUMENTS[name]
    monkeypatch.chdir(tmp_path)
    assert expected in fails(capsys, train.main, [*arguments, "--out", str(tmp_path / "run")])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("def get_config(): raise RuntimeError('boom')", "raised RuntimeError: boom"),
        ("import nonexistent_module", "raised ModuleNotFoundError"),
        ("x = 1", "defines no get_config()"),
        ("def get_configs(): return []", "defines no get_config() but get_configs(), which is for hcp_jax.sweep"),
        ("def get_config(): return {}['key']", "raised KeyError: 'key'"),
        ("def get_config(): return 3", "gave int, expected Config"),
        ("def broken(:", "raised SyntaxError"),
    ],
)
def test_a_config_file_that_fails_says_how(body, expected, tmp_path, capsys):
    path = experiment(tmp_path, body)
    assert expected in fails(capsys, train.main, ["--config", path, "--out", str(tmp_path / "run")])
    assert not (tmp_path / "run").exists()


def tiny_experiment(folder: pathlib.Path, config: Config) -> str:
    return experiment(
        folder,
        f"from hcp_jax.config import Config, from_dict\ndef get_config():\n    return from_dict(Config, {to_dict(config)!r})\n",
    )


def test_evaluate_refuses_other_robots_that_cannot_be_drawn_or_read(finished_run, pool, tmp_path, capsys):
    run = str(finished_run)
    assert "--range dampin: no such field; did you mean damping" in fails(
        capsys, evaluate.main, [run, "--range", "dampin", "1", "2"]
    )
    assert "low is above high" in fails(capsys, evaluate.main, [run, "--range", "damping", "2", "1"])
    assert "expected two numbers" in fails(capsys, evaluate.main, [run, "--range", "damping", "a", "1"])
    assert "not a robot pool" in fails(capsys, evaluate.main, [run, "--pool", str(tmp_path / "nowhere")])
    pool.save(tmp_path / "pool")
    assert "not with --pool" in fails(
        capsys, evaluate.main, [run, "--pool", str(tmp_path / "pool"), "--range", "damping", "1", "2"]
    )
    pool.replace(template=pool.template + "<!-- -->").save(tmp_path / "other")
    assert "another template" in fails(capsys, evaluate.main, [run, "--pool", str(tmp_path / "other")])
    (tmp_path / "pool" / "pool.npz").write_bytes(b"")
    assert "damaged" in fails(capsys, evaluate.main, [run, "--pool", str(tmp_path / "pool")])


def test_a_record_that_could_not_be_written_is_refused_before_the_work(finished_run, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "file" / "record.json", pathlib.Path("/proc/nowhere/record.json")):
        line = fails(capsys, evaluate.main, [str(finished_run), "--json", str(path)])
        assert f"argument --json: {path}: cannot be written (" in line
    assert (tmp_path / "file").read_text() == ""


def test_a_sweep_refuses_no_seeds_and_a_folder_of_another_setting(finished_run, tiny_config, tmp_path, capsys):
    path = pathlib.Path(tiny_experiment(tmp_path, tiny_config))
    path.write_text(path.read_text() + "def get_configs():\n    return [get_config()]\n")
    arguments = [str(path), "--out", str(tmp_path / "runs")]
    assert "list.py: no such file" in fails(capsys, sweep.main, ["list.py"])
    for words, expected in (
        (("--seeds", "0"), "--seeds=0: expected at least 1"),
        (("--cpus-per-run", "2"), "--cpus-per-run: goes with --ray"),
        (("--ray", "local", "--cpus-per-run", "0"), "--cpus-per-run=0: expected at least 1"),
        (("--out", str(path)), "experiment.py: exists and is no folder"),
    ):
        assert expected in fails(capsys, sweep.main, [*arguments, *words])
    shutil.copytree(finished_run, tmp_path / "runs" / "tiny_s0")
    line = fails(capsys, sweep.main, [*arguments, "--config.ppo.gamma=0.5"])
    assert "tiny_s0 was started with ppo.gamma=0.99, not 0.5" in line
    assert "--config.seed: a sweep has seeds" in fails(capsys, sweep.main, [*arguments, "--config.seed=3"])
    path.write_text(path.read_text().replace("[get_config()]", "[get_config()] * 2"))
    assert "two experiments of the list have this name" in fails(capsys, sweep.main, arguments)


BREAKING = [PhysicsOverflowError(3), OSError("no space left"), jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED:\nout of memory")]


@pytest.mark.parametrize(
    ("error", "code", "expected"),
    [*((error, 1, one_line(error)) for error in BREAKING), (KeyboardInterrupt(), 130, "interrupted")],
)
def test_what_breaks_a_command_is_said_in_one_line(error, code, expected, capsys):
    with pytest.raises(SystemExit) as exit_info, command_line.user_errors_end_the_command():
        raise error
    said = capsys.readouterr().err
    assert (exit_info.value.code, said.count("\n")) == (code, 1)
    assert expected in said


@pytest.mark.parametrize("error", [*BREAKING, ConfigError("init=x: no such folder")])
def test_a_run_that_breaks_does_not_keep_a_sweep_from_the_others(error, tiny_config, tmp_path, capsys, monkeypatch):
    def run_experiment(config, folder, interrupt):
        if config.seed == 0:
            raise error
        folder.mkdir(parents=True)

    monkeypatch.setattr(sweeping, "run_experiment", run_experiment)
    path = pathlib.Path(tiny_experiment(tmp_path, tiny_config))
    path.write_text(path.read_text() + "def get_configs():\n    return [get_config()]\n")
    with pytest.raises(SystemExit) as exit_info:
        sweep.main([str(path), "--seeds", "2", "--out", str(tmp_path / "runs")])
    assert exit_info.value.code == 1
    said = capsys.readouterr()
    assert "1 of 2 runs failed" in said.err
    assert f"tiny_s0: {one_line(error)}" in said.out
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["tiny_s1"]


def test_what_a_run_failed_with_is_said_though_the_user_interrupts_too(tiny_config, tmp_path, monkeypatch):
    def run_experiment(config, folder, interrupt):
        signal.raise_signal(signal.SIGINT)
        raise OSError("no space left")

    monkeypatch.setattr(sweeping, "run_experiment", run_experiment)
    jobs = [(tiny_config, tmp_path / "a"), (tiny_config, tmp_path / "b")]
    assert list(sweeping.run_here(jobs)) == [(jobs[0], "no space left")]


def test_ctrl_c_in_a_runs_last_seconds_ends_the_sweep_after_it(tiny_config, tmp_path, monkeypatch):
    def run_experiment(config, folder, interrupt):
        folder.mkdir()
        if config.seed == 0:
            signal.raise_signal(signal.SIGINT)  # too late for a checkpoint before the last
        return False

    monkeypatch.setattr(sweeping, "run_experiment", run_experiment)
    jobs = [(dataclasses.replace(tiny_config, seed=seed), tmp_path / f"tiny_s{seed}") for seed in range(2)]
    assert list(sweeping.run_here(jobs)) == [(jobs[0], None)]
    assert [path.name for path in tmp_path.iterdir()] == ["tiny_s0"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--tip", "hand"], "--base, --tip: go with --robot"),
        (["--fit-steps", "-5"], "--fit-steps=-5: expected at least 0"),
        (["--first-steps", "50", "-3"], "--first-steps=-3: expected at least 1"),
        (["--fit-steps", "5"], "--fit-steps: goes with a policy of hoppers"),
        (["--robot", str(POLICY / "config.json"), "--tip", "hand"], "config.json: was saved with its base and tip"),
        (["--robot", ""], "no name: no such file, and no arm of the catalogue: "),
    ],
)
def test_options_that_would_be_ignored_are_refused(arguments, expected, capsys):
    assert expected in fails(capsys, evaluate.main, [str(POLICY), *arguments])


def test_steps_to_fit_v_h_with_go_with_a_learned_one(capsys):
    line = fails(capsys, evaluate.main, [str(POLICY.parent / "hopper_ppo_s0"), "--fit-steps", "5"])
    assert "--fit-steps: goes with a learned v_h (encoding embedding), and this policy's is none" in line


@pytest.mark.parametrize("seed", ["-1", "1.5", "9223372036854775808"])
def test_a_seed_is_a_whole_number_that_a_key_takes(seed, capsys):
    assert f"{seed}: expected a whole number from 0 to 9223372036854775807" in fails(
        capsys, evaluate.main, [str(POLICY), "--seed", seed]
    )


@pytest.mark.parametrize("lacking", ["checkpoints/newest/8", "curves.png"])
def test_a_sweep_goes_on_with_a_run_that_lacks_what_is_written_last(lacking, finished_run, tiny_config, tmp_path, capsys):
    folder = shutil.copytree(finished_run, tmp_path / "tiny_s0")
    (shutil.rmtree if (folder / lacking).is_dir() else os.remove)(folder / lacking)
    assert not sweeping.run_experiment(tiny_config, folder)
    assert (folder / lacking).exists()
    assert capsys.readouterr().out
    assert not sweeping.run_experiment(tiny_config, folder)
    assert not capsys.readouterr().out, "it is done"


def test_a_sweep_refuses_fewer_steps_than_a_run_has_done(finished_run, tiny_config, tmp_path):
    jobs = [(dataclasses.replace(tiny_config, total_env_steps=256), shutil.copytree(finished_run, tmp_path / "tiny_s0"))]
    ((job, error),) = sweeping.run_here(jobs)
    assert job == jobs[0]
    assert "--config.total_env_steps=256: " in error
    assert "tiny_s0 is at 512 steps; expected no fewer" in error


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["physics", "--rows", "hcp_jax"], "--rows=hcp_jax: expected of physics: mj_step,"),
        (["learner", "--rows", "native"], "--rows=native: expected of learner: none"),
        (["scale", "--config", FINETUNE], "robot='panda': expected types of arms, or hoppers, for scale"),
    ],
)
def test_a_benchmark_names_what_it_cannot_measure(arguments, expected, capsys):
    assert expected in fails(capsys, benchmark.main, arguments)


def test_a_run_never_overwrites_another(finished_run, tiny_config, tmp_path, capsys):
    before = (finished_run / "metrics.csv").read_bytes()
    path = tiny_experiment(tmp_path, tiny_config)
    assert "already exists" in fails(capsys, train.main, ["--config", path, "--out", str(finished_run)])
    assert (finished_run / "metrics.csv").read_bytes() == before


def test_resuming_with_another_setting_names_it(finished_run, tiny_config, tmp_path, capsys):
    path = tiny_experiment(tmp_path, tiny_config)
    line = fails(capsys, train.main, ["--config", path, "--out", str(finished_run), "--resume", "--config.seed=4"])
    assert "seed=0, not 4" in line


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--resume"], "required: --config, unless --resume --out FOLDER"),
        (["--resume", "--out", "nowhere"], "nowhere: no such run folder"),
        (["--resume", "--out", str(POLICY)], "is a published policy; start a new run from it with --config.init="),
    ],
)
def test_resuming_what_is_no_run_is_refused(arguments, expected, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = sorted(POLICY.iterdir())
    assert expected in fails(capsys, train.main, arguments)
    assert (sorted(POLICY.iterdir()), list(tmp_path.iterdir())) == (before, [])


def test_resuming_an_empty_folder_is_refused(tiny_config, tmp_path, capsys):
    (tmp_path / "run").mkdir()
    path = tiny_experiment(tmp_path, tiny_config)
    assert "not a run folder" in fails(capsys, train.main, ["--config", path, "--out", str(tmp_path / "run"), "--resume"])
    assert list((tmp_path / "run").iterdir()) == []


def test_a_checkpoint_of_another_architecture_is_refused(finished_run, tiny_config, tmp_path, capsys):
    other = shutil.copytree(finished_run, tmp_path / "other")
    config = json.loads((other / "config.json").read_text())
    config["ppo"]["hidden_sizes"] = [16, 16]
    (other / "config.json").write_text(json.dumps(config))
    assert "another architecture" in fails(capsys, evaluate.main, [str(other), "--trials", "1", "--robots-per-trial", "2"])
    path = tiny_experiment(tmp_path, tiny_config)
    line = fails(capsys, train.main, ["--resume", "--out", str(other)])
    assert f"{other}/checkpoints/newest/8: another architecture" in line
    arguments = ["--config", path, "--out", str(tmp_path / "new"), f"--config.init={finished_run}"]
    assert "another architecture" in fails(capsys, train.main, [*arguments, "--config.ppo.hidden_sizes=(16,16)"])
    assert not (tmp_path / "new").exists()


def test_evaluate_refuses_what_is_not_a_run_and_impossible_counts(finished_run, tmp_path, capsys):
    assert "no such run folder" in fails(capsys, evaluate.main, [str(tmp_path / "nowhere")])
    assert "--trials=0: expected at least 1" in fails(capsys, evaluate.main, [str(finished_run), "--trials", "0"])
    assert "--types=H: expected types out of hopper" in fails(capsys, evaluate.main, [str(finished_run), "--types", "H"])
    assert "--physics" in fails(capsys, evaluate.main, [str(finished_run), "--physics", "bullet"])


def test_evaluate_writes_the_promised_record(finished_run, tmp_path, capsys):
    path = tmp_path / "record.json"
    evaluate.main(
        [str(finished_run), "--trials", "2", "--robots-per-trial", "3", "--physics", "native-rk4", "--json", str(path)]
    )
    record = json.loads(path.read_text())
    assert {"run", "task", "algorithm", "encoding", "physics", "trials", "robots_per_trial", "types", "return_mean"} <= set(
        record
    )
    assert record["integrator"] == "rk4"
    assert set(record["sets"]) == {"train", "heldout", "heldout_fitted"}
    assert len(record["robots"]) == 3 * 2 * 3
    assert "heldout_fitted" in capsys.readouterr().out


def test_rows_of_single_robots_can_be_left_out_of_the_record(finished_arms, tmp_path):
    path = tmp_path / "record.json"
    arguments = ["--types", "I", "--trials", "1", "--robots-per-trial", "1", "--without-robots", "--json", str(path)]
    evaluate.main([str(finished_arms), *arguments])
    record = json.loads(path.read_text())
    assert list(record["types"]) == ["I"]
    assert "robots" not in record


def test_field_names_are_those_of_the_json_file():
    assert "ppo.learning_rate" in field_names(Config)
    with pytest.raises(ConfigError, match="expected a list of float"):
        from_dict(Config, {"name": "x", "pool": {"ranges": {"damping": 3.0}}})

import dataclasses

import pytest

from hcp_jax.training import loop, run_folder
from hcp_jax.training.metrics import METRICS_FILE, TIMING_FILE, MetricsWriter
from hcp_jax.training.run_folder import RunFolderError

DAMAGED = {
    "short row": ("env_steps,train_return_mean,q\n64,1.0,2.0\n128,1.0\n", "the row of env_steps=128 has no q"),
    "long row": ("env_steps,train_return_mean\n64,1.0,2.0\n", "more columns than are named, after train_return_mean"),
    "no best metric": ("env_steps,q\n64,2.0\n", "column train_return_mean: expected a number in each row"),
    "a best metric that is none": ("env_steps,train_return_mean\n64,high\n", "column train_return_mean: expected a number"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_run_whose_metrics_are_damaged_is_not_gone_on_with_and_nothing_is_overwritten(name, tiny_config, tmp_path):
    content, expected = DAMAGED[name]
    run = loop.make_experiment(dataclasses.replace(tiny_config, total_env_steps=576))
    run_folder.write_start(tmp_path, tiny_config, run.physics)
    (tmp_path / METRICS_FILE).write_text(content)
    before = (tmp_path / run_folder.CONFIG_FILE).read_bytes()
    with pytest.raises(RunFolderError, match=rf"metrics\.csv: damaged or of another version \(.*{expected}"):
        loop._run(run, run.init_state(), tmp_path, resume=True, interrupt=loop.Interrupt())
    assert (tmp_path / METRICS_FILE).read_text() == content
    assert (tmp_path / run_folder.CONFIG_FILE).read_bytes() == before


def test_a_damaged_timing_leaves_the_metrics_as_they_are(tmp_path):
    rows = "env_steps,train_return_mean\n64,1\n128,2\n"
    (tmp_path / METRICS_FILE).write_text(rows)
    (tmp_path / TIMING_FILE).write_text("env_steps,seconds\n64\n")
    with pytest.raises(RunFolderError, match=r"timing\.csv: .*env_steps=64 has no seconds"):
        MetricsWriter(tmp_path, 64)
    assert (tmp_path / METRICS_FILE).read_text() == rows


def test_rows_of_a_version_with_another_column_are_not_mixed_with_new_ones(tmp_path):
    rows = "env_steps,colour\n64,1\n"
    (tmp_path / METRICS_FILE).write_text(rows)
    writer = MetricsWriter(tmp_path, 64)
    with pytest.raises(RunFolderError, match=r"metrics\.csv: .*column colour is none that this run has"):
        writer.write({"env_steps": 128, "q": 1.0}, {"env_steps": 128, "seconds": 1.0})
    writer.close()
    assert (tmp_path / METRICS_FILE).read_text() == rows

"""What is published of the arms: success by experiment and curves, from run folders."""

import pathlib
from collections.abc import Sequence

from hcp_jax.config import ArmConfig, ArmPoolConfig, Config
from hcp_jax.evaluation.appendix import make_appendix
from hcp_jax.evaluation.files import write_json
from hcp_jax.evaluation.groups import group_folders
from hcp_jax.evaluation.publishing import plot_groups, publish_runs
from hcp_jax.evaluation.summary import SUCCESSES, summarise_runs
from hcp_jax.evaluation.table1 import PREFIXES, find_stale, make_table1
from hcp_jax.training.run_folder import read_config


def collect_arms(folders: Sequence[pathlib.Path], results: pathlib.Path) -> list[str]:
    """Adds the arms' run folders, which may be none, to `results`; returns a line for each thing written.

    Each run's metrics under `arms/runs/` and its policy under `policies/`; from all runs there, `arms/summary.json` (a row per
    experiment) and a picture of the curves of each setting (`name_setting`); and `table1.json` and `appendix.json`, of the
    policies whose evaluations are there.
    """
    out = results / "arms"
    for make_rows in (make_table1, make_appendix):
        make_rows(results)  # a damaged evaluation is said before anything is written
    published, written = publish_runs(folders, out, results / "policies")
    if not published:
        return []
    write_json(out / "summary.json", summarise_runs(published))
    settings = {folder: name_setting(read_config(folder)) for folder in published}
    for setting in dict.fromkeys(settings.values()):
        groups = group_folders([folder for folder in published if settings[folder] == setting])
        plot_groups(groups, out / f"{setting}.png", SUCCESSES, "success [%] on held-out robots")
    for name, make_rows in (("table1", make_table1), ("appendix", make_appendix)):
        rows = make_rows(results)
        write_json(results / f"{name}.json", rows)
        written.append(f"{results}/{name}.json: {len(rows)} rows")
    written += find_stale(results)
    written.append(f"{out}/summary.json: {', '.join(group_folders(published))}")
    return written


def name_setting(config: Config) -> str:
    """What runs have in common that can be compared: the task, and the types that are left out, as in `random_peg_leave_h`."""
    assert isinstance(config.env, ArmConfig)
    assert isinstance(config.pool, ArmPoolConfig)
    prefix = PREFIXES[config.task, config.env.random_hole > 0]
    return f"{prefix}_leave_{''.join(config.pool.left_out).lower()}" if config.pool.left_out else f"{prefix}_other"

"""What is published of the arms: success by experiment and curves, from run folders."""

import pathlib
from collections.abc import Sequence

from hcp_jax.evaluation.appendix import make_appendix
from hcp_jax.evaluation.publishing import group_by_name, plot_groups, publish_runs
from hcp_jax.evaluation.statistics import write_json
from hcp_jax.evaluation.summary import SUCCESSES, summarise_runs
from hcp_jax.evaluation.table1 import make_table1
from hcp_jax.training.run_folder import read_config


def collect_arms(folders: Sequence[pathlib.Path], results: pathlib.Path) -> list[str]:
    """Writes into `results` from the arms' run folders; returns a line for each thing written.

    `arms/summary.json` (a row per experiment), `arms/TASK.png` (curves of each task's experiments), each run's metrics under
    `arms/runs/` and its policy under `policies/`; and `table1.json` and `appendix.json`, of the policies whose evaluations are
    there.
    """
    out = results / "arms"
    written = [publish_runs(folders, out, results / "policies")]
    write_json(out / "summary.json", summarise_runs(folders))
    for task in dict.fromkeys(read_config(folder).task for folder in folders):
        groups = group_by_name([folder for folder in folders if read_config(folder).task == task])
        plot_groups(groups, out / f"{task}.png", SUCCESSES, "success [%] on held-out robots")
    for name, make_rows in (("table1", make_table1), ("appendix", make_appendix)):
        rows = make_rows(results)
        write_json(results / f"{name}.json", rows)
        written.append(f"{results}/{name}.json: {len(rows)} rows")
    written.append(f"{out}/summary.json: {', '.join(group_by_name(folders))}")
    return written

"""The training loop: train a while, evaluate, record, save; resume exactly where a run was cut off.

train(config, folder):
  build pools, compile                     said on the first lines
  until all iterations are done:
    learner.train(state, chunk)              one jitted call of some seconds, a progress line after it
    at every eval_every steps:             evaluate, metrics.csv, checkpoint
"""

import contextlib
import dataclasses
import math
import pathlib
import signal
import threading
import time
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np

from hcp_jax.config import Config
from hcp_jax.devices import any_process, do_in_main, from_main, is_main
from hcp_jax.errors import NonFiniteError, PhysicsOverflowError
from hcp_jax.experiment.arm import load_own_robot
from hcp_jax.experiment.base import Experiment, TrainingState
from hcp_jax.experiment.build import make_experiment
from hcp_jax.physics.build import resolve_physics
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import Checkpoints, latest_iteration
from hcp_jax.training.curves import CURVES_FILE, plot_curves
from hcp_jax.training.metrics import METRICS_FILE, MetricsWriter, read_column
from hcp_jax.training.progress import Progress, format_seconds, say
from hcp_jax.training.warm_start import load_init

_CHUNK_SECONDS = 5.0  # of training between two progress lines, and until Ctrl-C is heard; at least one iteration
_NUM_NAMED = 3  # robots that an error names


@dataclasses.dataclass
class Interrupt:
    """Set by Ctrl-C or SIGTERM within its context: the loop ends after the current chunk."""

    requested: bool = False

    @contextlib.contextmanager
    def installed(self) -> Iterator["Interrupt"]:
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        before = {name: signal.signal(name, self._request) for name in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield self
        finally:
            for name, handler in before.items():
                signal.signal(name, handler)

    def _request(self, *_) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True


def train(
    config: Config, folder: pathlib.Path, resume: bool = False, interrupt: Interrupt | None = None
) -> dict[str, float] | None:
    """Trains `config` in `folder`, which all processes that train together see and process 0 writes.

    Args:
        config: settings.
        folder: of the run.
        resume: go on from its newest checkpoint.
        interrupt: of a caller who has it installed around several runs; by default the run installs its own.

    Returns:
        The last evaluation's metrics, or None if there was none: the run was interrupted, and saved, or was at its end already.

    Raises:
        RunFolderError, CheckpointError: the folder cannot be used; nothing was written.
        PhysicsOverflowError: the physics dropped contacts or constraints.
        NonFiniteError: losses or gradients stopped being finite; the newest checkpoint is from before.
    """
    do_in_main(lambda: _check_folder(folder, config, resume))
    if config.robot:
        load_own_robot(config)  # what is wrong with it is said before all else is compiled
    goes_on = resume and latest_iteration(folder / run_folder.CHECKPOINT_FOLDER) is not None
    init = load_init(config) if config.init and not goes_on else None
    say(f"{config.name}: compiling {config.pool.num_robots + config.pool.num_heldout} robots")
    run = make_experiment(config)
    state = run.init_state()
    if init is not None:
        state = init(run, state)
    with contextlib.ExitStack() as held:

        def open_folder() -> None:
            held.enter_context(run_folder.lock(folder))
            if not resume:
                run_folder.check_new(folder)  # another process may have come first
                run_folder.write_start(folder, config, run.physics)

        do_in_main(open_folder)
        return _run(run, state, folder, resume, held.enter_context(Interrupt().installed()) if interrupt is None else interrupt)


def _check_folder(folder: pathlib.Path, config: Config, resume: bool) -> None:
    """Raises RunFolderError where the run cannot start, or go on, in `folder`."""
    if resume:
        run_folder.check_resumable(folder, config)
        run_folder.check_physics(folder, resolve_physics(config.physics))
    else:
        run_folder.check_new(folder)


def _run(
    run: Experiment, state: TrainingState, folder: pathlib.Path, resume: bool, interrupt: Interrupt
) -> dict[str, float] | None:
    """Trains from the newest checkpoint, if there is one to resume from, else from `state`."""
    checkpoints = Checkpoints(folder / run_folder.CHECKPOINT_FOLDER, run.config.keep_checkpoints)
    iteration = 0
    if resume and checkpoints.iterations():
        iteration, state, skipped = checkpoints.restore(state)
        for line in skipped:
            say(line)
        say(f"resuming at {iteration * run.config.steps_per_iteration:,} steps")
    elif resume:
        say("the run ended before its first checkpoint: starting again")
    if iteration > run.config.num_iterations:
        done, total = iteration * run.config.steps_per_iteration, run.config.total_env_steps
        raise run_folder.RunFolderError(f"--config.total_env_steps={total}: {folder} is at {done:,} steps; expected no fewer")
    training = TrainingLoop(run, folder, checkpoints, iteration)
    if resume:
        do_in_main(lambda: _record_changes(folder, run.config))
    return training.run(state, interrupt)


def _record_changes(folder: pathlib.Path, config: Config) -> None:
    """Writes what a resumed run changes, and says what more steps mean for its schedules."""
    before = run_folder.read_config(folder).total_env_steps
    if config.total_env_steps > before:
        switch = config.algorithm == "ddpg" and config.ddpg.n_step > 1 and config.ddpg.n_step_from > 0.0
        stretched = "the decay of the step sizes" + (f" and the switch to {config.ddpg.n_step}-step returns" if switch else "")
        say(f"{config.total_env_steps:,} steps instead of {before:,}: stretched over the new length: {stretched}")
    run_folder.write_changes(folder, config)


class TrainingLoop:
    """Drives the learner's `train` and everything around it."""

    def __init__(self, run: Experiment, folder: pathlib.Path, checkpoints: Checkpoints, iteration: int):
        config = run.config
        self._run, self._folder, self._checkpoints, self._iteration = run, folder, checkpoints, iteration
        self._steps_per_iteration = config.steps_per_iteration
        self._chunk = 1  # iterations of the next jitted call
        self._eval_iterations = max(1, round(config.eval_every / self._steps_per_iteration))
        if is_main():
            read_column(folder / METRICS_FILE, run.best_metric)  # before the writer drops rows, and an evaluation needs it
        self._metrics = MetricsWriter(folder, self._env_steps) if is_main() else None
        self._progress = Progress(run.config.num_iterations * self._steps_per_iteration, self._env_steps)

    @property
    def _env_steps(self) -> int:
        return self._iteration * self._steps_per_iteration

    def run(self, state: TrainingState, interrupt: Interrupt) -> dict[str, float] | None:
        run, metrics = self._run, None
        for line in run.introduce(self._iteration):
            self._progress.say(line)
        devices, num_processes = jax.devices(), jax.process_count()
        where = f"{len(devices)} x {devices[0].device_kind}" if len(devices) > 1 else devices[0].device_kind
        where += f" of {num_processes} processes" if num_processes > 1 else ""
        self._progress.say(f"on {where}; compiling the training step")
        self._keep_best(state)
        if self._metrics and self._iteration < run.config.num_iterations:
            (self._folder / CURVES_FILE).unlink(missing_ok=True)  # a sweep takes it for the end of the run
        while self._iteration < run.config.num_iterations:
            next_eval = min((self._iteration // self._eval_iterations + 1) * self._eval_iterations, run.config.num_iterations)
            count = min(self._chunk, next_eval - self._iteration)
            began = time.monotonic()
            state = run.learner.train(state, count)
            self._iteration += count
            self._check(state)
            self._chunk = from_main(max(1, int(count * _CHUNK_SECONDS / (time.monotonic() - began))))
            self._progress.update(self._env_steps, run.describe(state))
            if self._iteration == next_eval:
                state, metrics = self._evaluate(state)
            if any_process(interrupt.requested) and self._iteration < run.config.num_iterations:
                return self._save_and_stop(state)
        self._finish()
        return metrics

    def _keep_best(self, state: TrainingState) -> None:
        """Where a run was killed after it had saved its newest checkpoint and before it had saved that as its best one."""
        rows = self._metrics.rows() if self._metrics else []
        is_newest = bool(rows) and int(rows[-1]["env_steps"]) == self._env_steps
        is_best = is_newest and self._best_metrics()[-1] >= self._best_so_far()
        if any_process(is_best):
            self._checkpoints.save(self._iteration, state, is_best=True)

    def _best_so_far(self) -> float:
        """The highest of the best metric in this process's `metrics.csv`."""
        return max(self._best_metrics(), default=-math.inf)

    def _best_metrics(self) -> list[float]:
        """The best metric of each evaluation so far, in the process that writes them."""
        return read_column(self._folder / METRICS_FILE, self._run.best_metric) if self._metrics else []

    def _check(self, state: TrainingState) -> None:
        overflow = int(state.overflow)
        if overflow:
            raise PhysicsOverflowError(overflow)
        if int(state.skipped.longest) >= self._run.config.max_skipped_updates:
            raise NonFiniteError(self._describe_skipped(state))

    def _describe_skipped(self, state: TrainingState) -> str:
        """Where training broke, and the robots that were in most of the updates skipped."""
        pool, counts = self._run.train_pool, np.asarray(state.skipped.robots)
        robots = []
        for row in np.argsort(-counts, kind="stable")[:_NUM_NAMED]:
            scalars = {name: np.round(values[row], 4).tolist() for name, values in pool.hardware.items() if values.ndim == 2}
            robots.append(f"robot {pool.robot_id[row]} in {counts[row]} of them ({scalars})")
        newest = self._checkpoints.iterations()
        kept = f"{newest[-1] * self._steps_per_iteration:,} steps" if newest else "none"
        return (
            f"{int(state.skipped.longest)} updates in a row had a loss or gradient that is not finite and were skipped, before "
            f"{self._env_steps:,} steps; last checkpoint: {kept}; {'; '.join(robots)}"
        )

    def _evaluate(self, state: TrainingState) -> tuple[TrainingState, dict[str, float]]:
        run = self._run
        evaluated, line = run.evaluate(state)
        diverged = np.asarray(state.diverged)
        counts = {
            "diverged_episodes": int(diverged.sum()),
            "diverged_robots": int((diverged > 0).sum()),
            "skipped_updates": int(state.skipped.total),
        }
        metrics = {"env_steps": self._env_steps, **evaluated, **run.learner_metrics(state), **counts}
        state = state.replace(sums=jax.tree.map(jnp.zeros_like, state.sums))
        is_best = False
        if self._metrics:
            is_best = metrics[run.best_metric] >= self._best_so_far()
            # The row first: a resumed run drops rows after its checkpoint, but could not make up for one that is missing.
            self._metrics.write(metrics, self._timing(self._metrics.seconds_before))
        self._checkpoints.save(self._iteration, state, any_process(is_best))
        self._progress.say(f"{self._env_steps:>12,} steps  {line}")
        self._report_diverged(diverged)
        return state, metrics

    def _timing(self, seconds_before: float) -> dict[str, float]:
        """A row of `timing.csv`: seconds of all processes of the run, speed of this one."""
        return {
            "env_steps": self._env_steps,
            "seconds": seconds_before + self._progress.elapsed,
            "steps_per_second": self._progress.steps_per_second(self._env_steps),
        }

    def _report_diverged(self, diverged: np.ndarray) -> None:
        if diverged.any():
            rows = np.flatnonzero(diverged)
            worst = ", ".join(f"{self._run.train_pool.robot_id[row]} ({diverged[row]})" for row in rows[:5])
            self._progress.say(f"physics diverged in {diverged.sum()} episodes so far; robots (episodes): {worst}")

    def _save_and_stop(self, state: TrainingState) -> None:
        self._checkpoints.save(self._iteration, state)
        self._checkpoints.wait()
        if self._metrics:
            self._metrics.write_timing(self._timing(self._metrics.seconds_before))
            self._metrics.close()
        self._progress.say(f"interrupted at {self._env_steps:,} steps; saved. Continue with --resume --out {self._folder}")

    def _finish(self) -> None:
        self._checkpoints.wait()
        self._checkpoints.close()
        if self._metrics:
            self._metrics.close()
            plot_curves(self._folder, self._folder / CURVES_FILE)
        self._progress.say(f"done in {format_seconds(self._progress.elapsed)}: {self._folder}")

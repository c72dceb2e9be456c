"""The training loop: train a while, evaluate, record, save; resume exactly where a run was cut off.

train(config, folder):
  build pools, compile                     said on the first lines
  until all iterations are done:
    ppo.train(state, chunk)                one jitted call, a progress line after it
    at every eval_every steps:             evaluate, metrics.csv, checkpoint
"""

import dataclasses
import math
import pathlib
import signal
import threading

import jax
import numpy as np

from hcp_jax.algorithms.ppo import PPOState, zero_sums
from hcp_jax.config import Config
from hcp_jax.envs.episodes import Episodes
from hcp_jax.experiment import EmbeddingFitter, Experiment, evaluate_run, make_experiment
from hcp_jax.physics.base import PhysicsOverflowError
from hcp_jax.training import run_folder
from hcp_jax.training.checkpoint import Checkpoints
from hcp_jax.training.curves import plot_curves
from hcp_jax.training.metrics import MetricsWriter
from hcp_jax.training.progress import Progress, format_seconds
from hcp_jax.training.warm_start import load_init

# Control steps between two progress lines: a few seconds of work.
_CHUNK_ENV_STEPS = 250_000
# The best checkpoint is the one with the highest of this: held-out robots choose nothing.
_BEST = "train_return_mean"


@dataclasses.dataclass
class Interrupt:
    """Set by Ctrl-C or SIGTERM: the loop ends after the current chunk."""

    requested: bool = False

    def install(self) -> None:
        if threading.current_thread() is threading.main_thread():
            for name in (signal.SIGINT, signal.SIGTERM):
                signal.signal(name, self._request)

    def _request(self, *_) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True


def train(config: Config, folder: pathlib.Path, resume: bool = False) -> dict[str, float] | None:
    """Trains `config` in `folder`.

    Returns:
        The last evaluation's metrics, or None if the run was interrupted (a checkpoint is saved then).

    Raises:
        RunFolderError, CheckpointError: the folder cannot be used; nothing was written.
        PhysicsOverflowError: the physics dropped contacts or constraints.
    """
    if resume:
        run_folder.check_resumable(folder, config)
    else:
        run_folder.check_new(folder)
    init = load_init(config) if config.init else None
    print(f"{config.name}: compiling {config.pool.num_robots + config.pool.num_heldout} robots", flush=True)
    run = make_experiment(config)
    state = run.init_state()
    if init is not None:
        state = init(run, state)
    checkpoints = Checkpoints(folder / run_folder.CHECKPOINT_FOLDER, config.keep_checkpoints)
    iteration = 0
    if resume and checkpoints.iterations():
        iteration, state, skipped = checkpoints.restore(state)
        for line in skipped:
            print(line, flush=True)
        print(f"resuming at {iteration * config.batch_size:,} steps", flush=True)
    elif resume:
        print("the run ended before its first checkpoint: starting again", flush=True)
    else:
        run_folder.write_start(folder, config, run.physics)
    interrupt = Interrupt()
    interrupt.install()
    loop = TrainingLoop(run, folder, checkpoints, iteration)
    return loop.run(state, interrupt)


class TrainingLoop:
    """Drives `PPO.train` and everything around it."""

    def __init__(self, run: Experiment, folder: pathlib.Path, checkpoints: Checkpoints, iteration: int):
        config = run.config
        self._run, self._folder, self._checkpoints, self._iteration = run, folder, checkpoints, iteration
        self._batch_size = config.batch_size
        self._chunk = max(1, round(_CHUNK_ENV_STEPS / self._batch_size))
        self._eval_iterations = max(1, round(config.eval_every / self._batch_size))
        self._fitter = None
        if run.ppo.conditioning.is_learned and config.embedding.fit_steps:
            self._fitter = EmbeddingFitter(run, run.heldout_pool, config.embedding.fit_steps)
        self._metrics = MetricsWriter(folder, self._env_steps)
        self._progress = Progress(run.num_iterations * self._batch_size, self._env_steps)

    @property
    def _env_steps(self) -> int:
        return self._iteration * self._batch_size

    def run(self, state: PPOState, interrupt: Interrupt) -> dict[str, float] | None:
        run, metrics = self._run, None
        self._progress.say(
            f"{run.config.resolved_num_envs} environments, physics {run.physics}, encoding {run.config.encoding}, "
            f"on {jax.devices()[0].device_kind}; compiling the training step"
        )
        if self._iteration < run.ppo.identify_iterations:
            steps = run.ppo.identify_iterations * self._batch_size
            self._progress.say(f"identifying robots for {steps:,} steps; after that the policy starts afresh and sees v_h")
        while self._iteration < run.num_iterations:
            next_eval = min((self._iteration // self._eval_iterations + 1) * self._eval_iterations, run.num_iterations)
            count = min(self._chunk, next_eval - self._iteration)
            state = run.ppo.train(state, count)
            self._iteration += count
            self._check(state)
            self._progress.update(self._env_steps, describe_training(state))
            if self._iteration == next_eval:
                state, metrics = self._evaluate(state)
            if interrupt.requested and self._iteration < run.num_iterations:
                return self._save_and_stop(state)
        self._finish(state)
        return metrics

    def _check(self, state: PPOState) -> None:
        overflow = int(state.overflow)
        if overflow:
            raise PhysicsOverflowError(overflow)

    def _evaluate(self, state: PPOState) -> tuple[PPOState, dict[str, float]]:
        run = self._run
        trained, heldout = evaluate_run(run, state)
        fitted = evaluate_run(run, state, self._fitter(state))[1] if self._fitter else None
        metrics = {"env_steps": self._env_steps, **summarise(trained, heldout, fitted), **learner_metrics(state)}
        timing = {
            "env_steps": self._env_steps,
            "seconds": self._progress.elapsed,
            "steps_per_second": self._progress.steps_per_second(self._env_steps),
        }
        state = state.replace(sums=zero_sums())
        is_best = metrics[_BEST] >= max((float(row[_BEST]) for row in self._metrics.rows()), default=-math.inf)
        # The row first: a resumed run drops rows after its checkpoint, but could not make up for one that is missing.
        self._metrics.write(metrics, timing)
        self._checkpoints.save(self._iteration, state, is_best)
        line = f"return {metrics['train_return_mean']:.0f} on training robots, {metrics['heldout_return_mean']:.0f} held out"
        if fitted is not None:
            line += f", {metrics['heldout_fitted_return_mean']:.0f} held out with fitted v_h"
        self._progress.say(f"{self._env_steps:>12,} steps  {line}")
        self._report_diverged(state)
        return state, metrics

    def _report_diverged(self, state: PPOState) -> None:
        diverged = np.asarray(state.diverged)
        if diverged.any():
            rows = np.flatnonzero(diverged)
            worst = ", ".join(f"{self._run.train_pool.robot_id[row]} ({diverged[row]})" for row in rows[:5])
            self._progress.say(f"physics diverged in {diverged.sum()} episodes so far; robots (episodes): {worst}")

    def _save_and_stop(self, state: PPOState) -> None:
        self._checkpoints.save(self._iteration, state)
        self._checkpoints.wait()
        self._metrics.close()
        self._progress.say(f"interrupted at {self._env_steps:,} steps; saved. Continue with --resume --out {self._folder}")

    def _finish(self, state: PPOState) -> None:
        self._checkpoints.wait()
        self._checkpoints.close()
        self._metrics.close()
        plot_curves([self._folder], self._folder / "curves.png")
        self._progress.say(f"done in {format_seconds(self._progress.elapsed)}: {self._folder}")


def summarise(trained: Episodes, heldout: Episodes, fitted: Episodes | None) -> dict[str, float | None]:
    """Mean and standard deviation over robots of the deterministic return, and mean episode length."""
    metrics: dict[str, float | None] = {}
    for name, episodes in (("train", trained), ("heldout", heldout), ("heldout_fitted", fitted)):
        metrics[f"{name}_return_mean"] = None if episodes is None else float(episodes.episode_return.mean())
        metrics[f"{name}_return_std"] = None if episodes is None else float(episodes.episode_return.std())
        metrics[f"{name}_episode_length"] = None if episodes is None else float(episodes.episode_length.mean())
    return metrics


def learner_metrics(state: PPOState) -> dict[str, float | int]:
    """Means since the last evaluation, and counts of diverged episodes."""
    sums = {name: float(value) for name, value in state.sums.items()}
    iterations, episodes = max(sums["iterations"], 1.0), sums["episodes"]
    diverged = np.asarray(state.diverged)
    means = ("policy_loss", "value_loss", "entropy", "approx_kl", "clip_fraction", "prediction_loss")
    return {
        "episode_return": sums["episode_return"] / episodes if episodes else math.nan,
        "episode_length": sums["episode_length"] / episodes if episodes else math.nan,
        **{name: sums[name] / iterations for name in means},
        "explained_variance": 1.0 - sums["value_error"] / max(sums["target_variance"], 1e-12),
        "diverged_episodes": int(diverged.sum()),
        "diverged_robots": int((diverged > 0).sum()),
    }


def describe_training(state: PPOState) -> str:
    """The return of training episodes since the last evaluation, for the progress line."""
    episodes = float(state.sums["episodes"])
    return f"return {float(state.sums['episode_return']) / episodes:>6.0f}" if episodes else "return    n/a"

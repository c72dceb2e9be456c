"""Checkpoints: asynchronous and atomic, the newest few and the best, with a fall-back past damaged ones."""

import logging
import pathlib

import jax
import orbax.checkpoint as ocp
from absl import logging as absl_logging
from orbax.checkpoint import checkpoint_managers

from hcp_jax.algorithms.ppo import PPOState

METRIC = "train_return_mean"


class CheckpointError(RuntimeError):
    """No usable checkpoint, or one that does not fit the configuration."""


class Checkpoints:
    """The `checkpoints/` folder of a run. A checkpoint's step is its number of iterations."""

    def __init__(self, folder: str | pathlib.Path, keep: int = 3, read_only: bool = False):
        absl_logging.set_verbosity(absl_logging.ERROR)
        logging.getLogger("orbax").setLevel(logging.ERROR)
        self.folder = pathlib.Path(folder).absolute()
        policies = [
            checkpoint_managers.LatestN(keep),
            checkpoint_managers.BestN(
                get_metric_fn=lambda metrics: metrics[METRIC], n=1, keep_checkpoints_without_metrics=False
            ),
        ]
        options = ocp.CheckpointManagerOptions(
            preservation_policy=checkpoint_managers.AnyPreservationPolicy(policies),
            best_fn=lambda metrics: metrics[METRIC],
            read_only=read_only,
            create=not read_only,
        )
        handlers = {"state": ocp.StandardCheckpointHandler()}
        self._manager = ocp.CheckpointManager(self.folder, options=options, item_handlers=handlers)

    def save(self, iteration: int, state: PPOState, metrics: dict[str, float] | None) -> None:
        """Starts writing in the background; the state's buffers may be donated as soon as this returns."""
        if iteration in self._manager.all_steps():
            return
        metrics = None if metrics is None else {METRIC: float(metrics[METRIC])}
        self._manager.save(iteration, args=ocp.args.Composite(state=ocp.args.StandardSave(state)), metrics=metrics)

    def wait(self) -> None:
        """Blocks until everything is on disk; raises what went wrong in the background."""
        self._manager.wait_until_finished()

    def close(self) -> None:
        self._manager.close()

    def iterations(self) -> list[int]:
        return sorted(self._manager.all_steps())

    def best(self) -> int | None:
        return self._manager.best_step()

    def restore(self, template: PPOState, iteration: int | None = None) -> tuple[int, PPOState, list[str]]:
        """Reads checkpoint `iteration`, or the newest one that can be read.

        Returns:
            its iteration, its state, and a line for each newer checkpoint that was damaged.

        Raises:
            CheckpointError: there is none, none can be read, or it is of another architecture.
        """
        candidates = [iteration] if iteration is not None else self.iterations()[::-1]
        if not candidates:
            raise CheckpointError(f"{self.folder}: holds no checkpoint")
        skipped = []
        for candidate in candidates:
            try:
                self._check_architecture(template, candidate)
                return candidate, self._read(template, candidate), skipped
            except CheckpointError:
                raise
            except Exception as error:  # orbax and tensorstore raise many kinds for damaged files
                reason = str(error).strip().splitlines()[0][:160] if str(error).strip() else type(error).__name__
                skipped.append(f"checkpoint {candidate} cannot be read and is passed over ({reason})")
        raise CheckpointError(f"{self.folder}: no readable checkpoint; {skipped[0]}")

    def _read(self, template: PPOState, iteration: int) -> PPOState:
        abstract = jax.tree.map(ocp.utils.to_shape_dtype_struct, template)
        restored = self._manager.restore(iteration, args=ocp.args.Composite(state=ocp.args.StandardRestore(abstract)))
        return restored.state

    def _check_architecture(self, template: PPOState, iteration: int) -> None:
        metadata = self._manager.item_metadata(iteration).state
        saved = {_name(path): tuple(leaf.shape) for path, leaf in jax.tree_util.tree_leaves_with_path(metadata.tree)
                 if hasattr(leaf, "shape")}  # fmt: skip
        for path, leaf in jax.tree_util.tree_leaves_with_path(template.params):
            name = "params/" + _name(path)
            if name not in saved:
                raise CheckpointError(f"{self.folder}/{iteration}: another architecture: it has no {name}")
            if saved[name] != leaf.shape:
                raise CheckpointError(
                    f"{self.folder}/{iteration}: another architecture: {name} is {saved[name]}, the config asks for {leaf.shape}"
                )


def _name(path) -> str:
    return "/".join(str(getattr(key, "key", getattr(key, "name", getattr(key, "idx", key)))) for key in path)

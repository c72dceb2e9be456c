"""Checkpoints: asynchronous and atomic, the newest few and the best, with a fall-back past damaged ones."""

import itertools
import logging
import pathlib
from collections.abc import Mapping

import jax
import orbax.checkpoint as ocp
from absl import logging as absl_logging

from hcp_jax.devices import any_process, is_main
from hcp_jax.errors import UserError, one_line
from hcp_jax.experiment.base import TrainingState


class CheckpointError(UserError):
    """No usable checkpoint, or one that does not fit the configuration."""


class Checkpoints:
    """The `checkpoints/` folder of a run: `newest/` and `best/`, each with a folder per number of iterations.

    Of several processes each must make the same calls; what is on all devices, process 0 writes.
    """

    def __init__(self, folder: str | pathlib.Path, keep: int = 3, read_only: bool = False):
        absl_logging.set_verbosity(absl_logging.FATAL)
        logging.getLogger("orbax").setLevel(logging.ERROR)
        self.folder = pathlib.Path(folder).absolute()
        self._read_only = read_only
        self._newest = self._make_manager("newest", keep)
        self._best = self._make_manager("best", 1)

    def _make_manager(self, name: str, keep: int) -> ocp.CheckpointManager:
        # Two managers save at once: processes must not take one's barrier for the other's.
        processes = ocp.options.MultiprocessingOptions(barrier_sync_key_prefix=name)
        options = ocp.CheckpointManagerOptions(
            max_to_keep=keep,
            read_only=self._read_only,
            create=not self._read_only,
            multiprocessing_options=processes,
        )
        handlers = {"state": ocp.StandardCheckpointHandler(multiprocessing_options=processes)}
        return ocp.CheckpointManager(self.folder / name, options=options, item_handlers=handlers)

    def save(self, iteration: int, state: TrainingState, is_best: bool = False) -> None:
        """Starts writing in the background; the state's buffers may be donated as soon as this returns.

        Where a run goes on from before its best checkpoint, the next best one replaces it.
        """
        newer = [step for step in self._best.all_steps() if step > iteration] if is_best else []
        if newer:
            self._best.wait_until_finished()
        for step in newer:
            self._best.delete(step)
        for manager in (self._newest, self._best) if is_best else (self._newest,):
            if iteration not in manager.all_steps():
                manager.save(iteration, args=ocp.args.Composite(state=ocp.args.StandardSave(state)))

    def wait(self) -> None:
        """Blocks until everything is on disk; raises what went wrong in the background."""
        self._newest.wait_until_finished()
        self._best.wait_until_finished()

    def close(self) -> None:
        self._newest.close()
        self._best.close()

    def iterations(self) -> list[int]:
        """The newest checkpoints, oldest first."""
        return sorted(self._newest.all_steps())

    def best(self) -> int | None:
        return self._best.latest_step()

    def restore_best(self, template: TrainingState) -> tuple[int, TrainingState]:
        """The policy with the highest return or success, in `template`. Raises CheckpointError if none can be read."""
        iteration = self.best()
        if iteration is None:
            raise CheckpointError(f"{self.folder}: holds no best checkpoint")
        try:
            return iteration, self._read_checked(self._best, template, iteration, policy_only=True)
        except CheckpointError:
            raise
        except Exception as error:
            raise CheckpointError(f"{self.folder}: the best checkpoint, {iteration}, cannot be read ({_say(error)})") from error

    def restore(self, template: TrainingState, policy_only: bool = False) -> tuple[int, TrainingState, list[str]]:
        """Reads the newest checkpoint that can be read. Damaged newer ones are moved aside, unless this is read-only.

        Args:
            template: a state of the config's shapes.
            policy_only: read `policy_fields` alone, whatever else was saved; the rest is the template's.

        Returns:
            its iteration, its state, and a line for each newer checkpoint that was damaged.

        Raises:
            CheckpointError: there is none, none can be read, or it is of another architecture.
        """
        if not self.iterations():
            raise CheckpointError(f"{self.folder}: holds no checkpoint")
        damaged: dict[int, str] = {}
        for iteration in self.iterations()[::-1]:
            try:
                state = self._read_checked(self._newest, template, iteration, policy_only)
            except CheckpointError:
                raise
            except Exception as error:  # orbax and tensorstore raise many kinds for damaged files
                damaged[iteration] = f"checkpoint {iteration} cannot be read and is passed over ({_say(error)})"
            else:
                for newer in damaged:
                    self._move_aside(newer)
                return iteration, state, list(damaged.values())
        raise CheckpointError(f"{self.folder}: no readable checkpoint; {next(iter(damaged.values()))}")

    def _move_aside(self, iteration: int) -> None:
        if not self._read_only:
            if is_main():
                damaged = self.folder / "damaged"
                damaged.mkdir(exist_ok=True)
                names = itertools.chain([f"{iteration}"], (f"{iteration}_{number}" for number in itertools.count(2)))
                aside = next(damaged / name for name in names if not (damaged / name).exists())
                (self.folder / "newest" / str(iteration)).rename(aside)
            any_process(False)  # the others wait for it
            self._newest.reload()

    def _read_checked(
        self, manager: ocp.CheckpointManager, template: TrainingState, iteration: int, policy_only: bool
    ) -> TrainingState:
        self._check_architecture(manager, template, iteration)
        return (self._read_policy if policy_only else self._read)(manager, template, iteration)

    def _read(self, manager: ocp.CheckpointManager, template: TrainingState, iteration: int) -> TrainingState:
        abstract = jax.tree.map(ocp.utils.to_shape_dtype_struct, template)
        restored = manager.restore(iteration, args=ocp.args.Composite(state=ocp.args.StandardRestore(abstract)))
        return restored.state

    def _read_policy(self, manager: ocp.CheckpointManager, template: TrainingState, iteration: int) -> TrainingState:
        fields = {name: getattr(template, name) for name in template.policy_fields}
        abstract = jax.tree.map(ocp.utils.to_shape_dtype_struct, fields)
        restore_args = ocp.checkpoint_utils.construct_restore_args(abstract)
        arguments = ocp.args.PyTreeRestore(item=abstract, restore_args=restore_args, partial_restore=True)
        with ocp.Checkpointer(ocp.PyTreeCheckpointHandler()) as reader:
            return template.replace(**reader.restore(manager.directory / str(iteration) / "state", args=arguments))

    def _check_architecture(self, manager: ocp.CheckpointManager, template: TrainingState, iteration: int) -> None:
        metadata = manager.item_metadata(iteration).state
        saved = {leaf_name(path): tuple(leaf.shape) for path, leaf in jax.tree_util.tree_leaves_with_path(metadata.tree)
                 if hasattr(leaf, "shape")}  # fmt: skip
        check_architecture(saved, template, f"{manager.directory / str(iteration)}")


def latest_iteration(folder: pathlib.Path) -> int | None:
    """The number of iterations of the newest checkpoint in the `checkpoints/` folder of a run, without reading it."""
    finished = [int(path.name) for path in folder.glob("newest/*") if path.name.isdecimal()]
    return max(finished, default=None)


def _say(error: Exception) -> str:
    return one_line(error)[:160] or type(error).__name__


def check_architecture(saved: Mapping[str, tuple[int, ...]], template: TrainingState, where: str) -> None:
    """Raises CheckpointError unless `saved`, shapes by name, has every parameter of `template` in its shape."""
    for path, leaf in jax.tree_util.tree_leaves_with_path(template.params):
        name = "params/" + leaf_name(path)
        if name not in saved:
            raise CheckpointError(f"{where}: another architecture: it has no {name}")
        if saved[name] != leaf.shape:
            raise CheckpointError(f"{where}: another architecture: {name} is {saved[name]}, the config asks for {leaf.shape}")


def leaf_name(path) -> str:
    """A leaf's place in its pytree: `params/network/...`."""
    return "/".join(str(getattr(key, "key", getattr(key, "name", getattr(key, "idx", key)))) for key in path)

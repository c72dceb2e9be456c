"""A robot pool: many compiled variants of one template, stacked along a leading axis."""

import hashlib
import importlib.resources
import json
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct

from hcp_jax.errors import UserError

# Every MjModel field that lengths, masses and joint dynamics drag along. `stack_models` refuses variants that differ in
# any other field, so that a field can be forgotten neither here nor by a backend.
VARIANT_FIELDS = (
    "actuator_acc0",
    "actuator_gear",
    "body_inertia",
    "body_invweight0",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_pos",
    "body_quat",
    "body_subtreemass",
    "bvh_aabb",
    "dof_M0",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
    "dof_invweight0",
    "dof_length",
    "geom_aabb",
    "geom_pos",
    "geom_quat",
    "geom_rbound",
    "geom_size",
    "jnt_range",
    "light_poscom0",
)
# Scales the solver's tolerance; MJX cannot batch it, native physics does.
MEAN_INERTIA = "stat.meaninertia"
FORMAT = 1

Array = Any  # numpy.ndarray on the host, jax.Array in jitted code


class PoolError(UserError):
    """A pool's files are missing, damaged or of another format, or its robots do not fit one template."""


def robots_path() -> pathlib.Path:
    """The folder of robot templates: `robots/` of a checkout, or the copy inside an installed wheel."""
    installed = importlib.resources.files("hcp_jax") / "_robots"
    folder = pathlib.Path(str(installed))
    return folder if folder.is_dir() else pathlib.Path(__file__).resolve().parents[2] / "robots"


@struct.dataclass
class RobotPool:
    """N robots of one template.

    Attributes:
        template: MJCF text that every robot was compiled from.
        fields: MjModel fields that differ between robots, by name: [N, ...] float64.
        hardware: sampled and derived parameters in SI units, by name: [N, ...] float64 (of arms: `make_chain_pool`).
        robot_id: [N] int32, a robot's number in the pool it was made in.
    """

    template: str = struct.field(pytree_node=False)
    fields: dict[str, Array]
    hardware: dict[str, Array]
    robot_id: Array

    @property
    def num_robots(self) -> int:
        return self.robot_id.shape[0]

    def take(self, index: Array) -> "RobotPool":
        """The robots at positions `index` [B], in that order (repeats allowed)."""
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, _device_dtype(leaf))[index], self)

    def subset(self, index: Sequence[int] | np.ndarray) -> "RobotPool":
        """`take` on the host in float64, keeping each robot's id."""
        return jax.tree.map(lambda leaf: np.asarray(leaf)[np.asarray(index)], self)

    def template_model(self) -> mujoco.MjModel:
        """The nominal robot, compiled."""
        return mujoco.MjModel.from_xml_string(self.template)

    def models(self) -> list[mujoco.MjModel]:
        """One MjModel per robot, rebuilt from the stacked fields."""
        template = self.template_model()
        models = []
        for row in range(self.num_robots):
            model = template.__copy__()
            for name, values in self.fields.items():
                if name == MEAN_INERTIA:
                    model.stat.meaninertia = values[row]
                else:
                    getattr(model, name)[:] = values[row]
            models.append(model)
        return models

    def save(self, folder: str | pathlib.Path) -> None:
        """Writes the pool as `pool.json`, `template.xml` and `pool.npz` (data only). Raises FileExistsError."""
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=False)
        arrays = {f"fields/{k}": v for k, v in self.fields.items()} | {f"hardware/{k}": v for k, v in self.hardware.items()}
        np.savez_compressed(folder / "pool.npz", **(arrays | {"robot_id": self.robot_id}))
        (folder / "template.xml").write_text(self.template)
        description = {
            "format": FORMAT,
            "num_robots": self.num_robots,
            "sha256": hashlib.sha256((folder / "pool.npz").read_bytes()).hexdigest(),
        }
        (folder / "pool.json").write_text(json.dumps(description, indent=2) + "\n")

    @classmethod
    def load(cls, folder: str | pathlib.Path) -> "RobotPool":
        """Reads what `save` wrote. Raises PoolError if a file is missing, damaged or of another format."""
        folder = pathlib.Path(folder)
        try:
            description = json.loads((folder / "pool.json").read_text())
            if description["format"] != FORMAT:
                raise PoolError(f"{folder}/pool.json: format {description['format']}, this version reads {FORMAT}")
            if hashlib.sha256((folder / "pool.npz").read_bytes()).hexdigest() != description["sha256"]:
                raise PoolError(f"{folder}/pool.npz: damaged (its checksum differs from pool.json)")
            with np.load(folder / "pool.npz", allow_pickle=False) as arrays:
                groups = {"fields": {}, "hardware": {}}
                for key in arrays.files:
                    if key != "robot_id":
                        group, name = key.split("/", 1)
                        groups[group][name] = arrays[key]
                return cls((folder / "template.xml").read_text(), groups["fields"], groups["hardware"], arrays["robot_id"])
        except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
            if isinstance(error, PoolError):
                raise
            raise PoolError(f"{folder}: not a robot pool ({error})") from error


def _device_dtype(leaf: Array):
    return jnp.int32 if jnp.issubdtype(leaf.dtype, jnp.integer) else jnp.float32


def stack_models(models: Iterable[mujoco.MjModel]) -> dict[str, np.ndarray]:
    """Stacks the fields in `VARIANT_FIELDS` of models compiled from one template, of which it keeps none.

    Raises:
        PoolError: the models differ in their sizes or in a field outside `VARIANT_FIELDS`.
    """
    rows: dict[str, list] = {name: [] for name in (*VARIANT_FIELDS, MEAN_INERTIA)}
    reference: dict[str, bytes] = {}
    for robot, model in enumerate(models):
        if not robot:
            reference = {name: getattr(model, name).tobytes() for name in _array_fields(model) if name not in VARIANT_FIELDS}
        for name, values in reference.items():
            if getattr(model, name).tobytes() != values:
                raise PoolError(f"robot {robot} differs from robot 0 in MjModel.{name}, which pools do not batch")
        for name in VARIANT_FIELDS:
            rows[name].append(getattr(model, name).copy())
        rows[MEAN_INERTIA].append(model.stat.meaninertia)
    return {name: np.stack(values) for name, values in rows.items()}


def _array_fields(model: mujoco.MjModel) -> list[str]:
    return [name for name in dir(model) if not name.startswith("_") and isinstance(getattr(model, name), np.ndarray)]


def concatenate_pools(*pools: RobotPool) -> RobotPool:
    """One pool of all robots, in that order. Where some have fewer start poses, those come more than once.

    Raises:
        PoolError: their templates differ.
    """
    if any(pool.template != pools[0].template for pool in pools):
        raise PoolError("pools of different templates cannot be concatenated")
    poses = [pool.hardware["start_angles"].shape[1] for pool in pools if "start_angles" in pool.hardware]
    if poses:
        same = ({"start_angles": repeat_poses(pool.hardware["start_angles"], max(poses))} for pool in pools)
        pools = tuple(pool.replace(hardware=pool.hardware | angles) for pool, angles in zip(pools, same, strict=True))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *pools)


def repeat_poses(angles: np.ndarray, count: int) -> np.ndarray:
    """As many as `count` of the start poses [N, S, 7], from the first again after the last."""
    return angles[:, np.arange(count) % angles.shape[1]]

"""Which robots a policy is evaluated on, beside those that its run would draw: of other ranges, or of a saved pool."""

import pathlib
from collections.abc import Sequence

from hcp_jax.config import Config, ConfigError, from_dict, to_dict, unknown_field
from hcp_jax.experiment.chosen_robots import heldout_kinds
from hcp_jax.hardware.arm import CHAIN_TYPES
from hcp_jax.hardware.pool import RobotPool

RangeChange = tuple[str, float, float]  # name, low, high


def check_types(config: Config, types: Sequence[str]) -> None:
    """Raises ConfigError for a type that the run's task has not."""
    known = heldout_kinds(config)
    for name in types:
        if name not in known:
            raise ConfigError(f"--types={name}: expected types out of {', '.join(known)}")


def change_ranges(config: Config, changes: Sequence[RangeChange], types: Sequence[str] = ()) -> Config:
    """`config` with other ranges of hardware for robots of `types`. Raises ConfigError or RangeError."""
    values = to_dict(config)
    pool = values["pool"]
    # Random chains have ranges of their own, some under the names of the others'.
    are_chains = {name in CHAIN_TYPES for name in types}
    if changes and len(are_chains) > 1:
        raise ConfigError(f"--range {changes[0][0]}: types {', '.join(types)} have no ranges in common; choose with --types")
    ranges = pool["chain_ranges"] if True in are_chains else pool["ranges"]
    known = sorted(name for name, bounds in ranges.items() if not isinstance(bounds, float))
    for name, low, high in changes:
        if name not in known:
            raise ConfigError(unknown_field(f"--range {name}", known))
        ranges[name] = (low, high)
    return from_dict(Config, values)


def load_pool(folder: pathlib.Path, train_pool: RobotPool) -> RobotPool:
    """A saved pool of the robots that a run is about. Raises PoolError if it cannot be read, ConfigError if it is of others."""
    pool = RobotPool.load(folder)
    if pool.template != train_pool.template:
        raise ConfigError(f"--pool={folder}: robots of another template than the run's")
    return pool

"""What every setting is checked with."""

import math

from hcp_jax.errors import UserError

MAX_SEED = 2**63 - 1  # what a JAX key takes


class ConfigError(UserError):
    """A setting is unknown, of the wrong type or outside what is allowed. The message names field, value and bounds."""


def require(condition: bool, field: str, value: object, allowed: str) -> None:
    """Raises ConfigError unless `condition` holds: `allowed` says what does."""
    if not condition:
        raise ConfigError(f"{field}={value!r}: expected {allowed}")


def is_positive(value: float) -> bool:
    return math.isfinite(value) and value > 0


def is_at_least_zero(value: float) -> bool:
    return math.isfinite(value) and value >= 0

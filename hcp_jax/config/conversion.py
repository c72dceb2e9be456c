"""Settings as plain dictionaries and back, and the dotted paths of their fields."""

import dataclasses
import difflib
import types
import typing

from hcp_jax.config.checks import ConfigError


def to_dict(config) -> dict:
    """The config as plain nested dictionaries."""
    return dataclasses.asdict(config)


def from_dict(cls, values: dict, path: str = ""):
    """Builds dataclass `cls` from what `to_dict` gave. Fields that are not given take their defaults.

    Raises:
        ConfigError: a field is unknown or ill-typed, or one without a default is missing.
    """
    if not isinstance(values, dict):
        raise ConfigError(f"{path or cls.__name__}={values!r}: expected fields {', '.join(field_names(cls))}")
    hints = typing.get_type_hints(cls)
    arguments = {}
    for name, value in values.items():
        where = f"{path}{name}"
        if name not in hints:
            raise ConfigError(unknown_field(where, [f"{path}{n}" for n in hints]))
        arguments[name] = _convert(hints[name], value, where)
    try:
        return cls(**arguments)
    except TypeError as error:
        raise ConfigError(f"{path or cls.__name__}: {error}") from error


def unknown_field(name: str, known: list[str]) -> str:
    """One line that names the fields nearest to `name`."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known fields: {', '.join(sorted(known))}"
    return f"{name}: no such field; {hint}"


def field_names(config, path: str = "") -> list[str]:
    """Dotted paths of all leaf fields of a dataclass of dataclasses (a class without unions, or an instance)."""
    names = []
    for name, hint in typing.get_type_hints(type(config) if not isinstance(config, type) else config).items():
        part = hint if isinstance(config, type) else getattr(config, name)
        names += field_names(part, f"{path}{name}.") if dataclasses.is_dataclass(part) else [f"{path}{name}"]
    return names


def _convert(hint, value, where: str):
    if isinstance(hint, types.UnionType):
        hint = _choose(typing.get_args(hint), value)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, f"{where}.")
    origin = typing.get_origin(hint)
    if origin is tuple:
        item = typing.get_args(hint)[0]
        if not isinstance(value, (list, tuple)):
            raise ConfigError(f"{where}={value!r}: expected a list of {item.__name__}")
        return tuple(_convert(item, v, where) for v in value)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not hint:
        raise ConfigError(f"{where}={value!r}: expected {hint.__name__}, not {type(value).__name__}")
    return value


def _choose(kinds: tuple[type, ...], value) -> type:
    """The dataclass out of `kinds` that has most of the fields in `value`."""
    fields = set(value) if isinstance(value, dict) else set()
    return max(kinds, key=lambda kind: len(fields & set(typing.get_type_hints(kind))))

"""Files of results: written as JSON, and read back. What is damaged is an error that names its file."""

import contextlib
import csv
import json
import math
import pathlib
import re
from collections.abc import Iterator

from hcp_jax.errors import UserError
from hcp_jax.training.run_folder import RunFolderError

# A list of numbers that json.dumps spreads over lines. Texts hold no line breaks in JSON, so it is no part of one.
_NUMBERS = re.compile(r"\[\n([-+\d.eE,\s]+)\]")


class RecordError(UserError):
    """A published file is damaged, or was written by another version."""


@contextlib.contextmanager
def naming(path: pathlib.Path) -> Iterator[None]:
    """Whatever is wrong with a file's content becomes a RecordError that names it."""
    try:
        yield
    except (RecordError, RunFolderError):  # name it already
        raise
    except KeyError as error:
        raise RecordError(f"{path}: damaged or of another version (no field {error})") from error
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError, csv.Error) as error:
        raise RecordError(f"{path}: damaged or of another version ({error})") from error


def read_json(path: pathlib.Path, kind: type):
    """The `kind` (dict or list) in a JSON file. Raises RecordError if it is damaged or holds something else."""
    with naming(path):
        content = json.loads(path.read_text())
        if not isinstance(content, kind):
            raise TypeError(f"holds a {type(content).__name__}, expected a {kind.__name__}")
        return content


def number(value: object) -> float:
    """A finite number of a record. Raises ValueError."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is no finite number")
    return float(value)


def optional_number(value: object) -> float | None:
    return None if value is None else number(value)


def write_json(path: pathlib.Path, record: dict | list) -> None:
    """Writes one record, indented, lists of numbers on one line, with numbers that JSON has."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(record, indent=1, allow_nan=False)
    path.write_text(_NUMBERS.sub(lambda match: "[" + " ".join(match[1].split()) + "]", text) + "\n")

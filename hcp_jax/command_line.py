"""What the commands share: reading an experiment file, overriding its fields, and ending on bad input with one line."""

import argparse
import contextlib
import os
import pathlib
import re
import runpy
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence

import jax
from absl import flags
from ml_collections import ConfigDict, config_flags
from rich.console import Console

from hcp_jax.config import MAX_SEED, Config, ConfigError, field_names, from_dict, to_dict, unknown_field
from hcp_jax.errors import BREAKING_ERRORS, UserError, one_line
from hcp_jax.hardware.catalogue import catalogue_names
from hcp_jax.physics.base import INTEGRATORS, PHYSICS

BAD_INPUT, BROKEN, INTERRUPTED = 2, 1, 130
OWN_ARM = f"your arm, a URDF or MJCF file (see hcp_jax.robot check), or one of {', '.join(catalogue_names())}"
_RUN_BY = {"get_config": "hcp_jax.train", "get_configs": "hcp_jax.sweep"}  # what an experiment file defines
_OVERRIDE = re.compile(r"--config\.([^=\s]+)(=.*)?$", re.DOTALL)


class OneLineParser(argparse.ArgumentParser):
    """argparse, but an error is one line."""

    def __init__(self, **kwargs):
        super().__init__(allow_abbrev=False, **kwargs)

    def error(self, message: str):
        self.exit(BAD_INPUT, f"{self.prog}: {message}\n")


@contextlib.contextmanager
def user_errors_end_the_command() -> Iterator[None]:
    """Bad input ends the process with one line on stderr and exit code 2, what broke on the way with one and exit code 1,
    Ctrl-C with one and exit code 130."""
    try:
        yield
    except UserError as error:
        print(one_line(error), file=sys.stderr)
        sys.exit(BAD_INPUT)
    except BREAKING_ERRORS as error:
        print(one_line(error), file=sys.stderr)
        sys.exit(BROKEN)
    except KeyboardInterrupt:
        print("interrupted; what was not saved is lost", file=sys.stderr)
        sys.exit(INTERRUPTED)


def new_output(word: str) -> pathlib.Path:
    """A path on the command line where a file or folder will be made. Where none can be, the command ends before its work."""
    path = pathlib.Path(word)
    try:
        place = path if path.is_dir() else next(parent for parent in path.absolute().parents if parent.exists())
        tempfile.TemporaryFile(dir=place).close()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{word}: cannot be written ({error.strerror})") from error
    return path


def output_folder(word: str) -> pathlib.Path:
    """A path on the command line of a folder that will be written into, and made if it is missing."""
    path = new_output(word)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{word}: exists and is no folder")
    return path


def output_file(*suffixes: str) -> Callable[[str], pathlib.Path]:
    """Reads a path on the command line that a file will be written to; over an older one if that ends in one of `suffixes`."""

    def read(word: str) -> pathlib.Path:
        path = pathlib.Path(word)
        if not path.exists():
            return new_output(word)
        if path.is_file() and path.suffix not in suffixes:
            raise argparse.ArgumentTypeError(
                f"{word}: exists: expected a new file, or one that ends in {' or '.join(suffixes)}"
            )
        try:
            path.open("a").close()
        except OSError as error:
            raise argparse.ArgumentTypeError(f"{word}: cannot be written ({error.strerror})") from error
        return path

    return read


def show(*things: object) -> None:
    """Prints lines and rich tables to the terminal; brackets in them are text and no markup."""
    Console(markup=False).print(*things)


def seed(word: str) -> int:
    """A seed on the command line."""
    if not word.isdecimal() or int(word) > MAX_SEED:
        raise argparse.ArgumentTypeError(f"{word}: expected a whole number from 0 to {MAX_SEED}")
    return int(word)


def add_chain_options(parser: argparse.ArgumentParser) -> None:
    """Which part of an arm's file is the arm."""
    parser.add_argument("--base", help="link that stands still at the origin; default: the file's root, where it stands")
    parser.add_argument("--tip", help="last link, whose origin is the point of interest; default: the end of the only chain")


def add_physics_option(parser: argparse.ArgumentParser) -> None:
    choices = [*PHYSICS, *(f"native-{name}" for name in INTEGRATORS)]
    parser.add_argument("--physics", default="auto", choices=choices, help="engine; native-rk4: with that integrator")


def enable_compilation_cache() -> None:
    """Keeps compiled programs between runs, in `JAX_COMPILATION_CACHE_DIR` or the user's cache folder."""
    if not jax.config.jax_compilation_cache_dir:
        cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")).expanduser()
        jax.config.update("jax_compilation_cache_dir", str(cache / "hcp_jax" / "xla"))
        # Most programs compile in less than JAX's threshold of a second, and a start has hundreds of them. Programs that call
        # back to the native engine are never kept.
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def load_config(path: str, overrides: Sequence[str] = ()) -> Config:
    """Runs an experiment file (a Python file: it is executed) and applies `--config.FIELD=VALUE` overrides.

    Raises:
        ConfigError: the file is missing, raises or gives no `Config`; a field is unknown or its value ill-typed.
    """
    return apply_overrides(_run_experiment(f"--config={path}", path, "get_config", Config), overrides)


def load_configs(path: str) -> list[Config]:
    """Runs an experiment list: a Python file whose `get_configs()` gives several `Config`s. Raises ConfigError."""
    configs = _run_experiment(path, path, "get_configs", list)
    for config in configs:
        if not isinstance(config, Config):
            raise ConfigError(f"{path}: get_configs() gave a list with {type(config).__name__}, expected Config")
    return configs


def _run_experiment(said: str, path: str, function: str, kind: type):
    """What `function` of the file gives. `said` is how errors call it."""
    if not pathlib.Path(path).is_file():
        raise ConfigError(f"{said}: no such file")
    try:
        defined = runpy.run_path(path)
        if function not in defined:
            other = next((f" but {name}(), which is for {command}" for name, command in _RUN_BY.items() if name in defined), "")
            raise ConfigError(f"{said}: defines no {function}(){other}")
        result = defined[function]()
    except UserError:
        raise
    except (Exception, SystemExit) as error:
        raise ConfigError(f"{said}: raised {type(error).__name__}: {error}") from error
    if not isinstance(result, kind):
        raise ConfigError(f"{said}: {function}() gave {type(result).__name__}, expected {kind.__name__}")
    return result


def apply_overrides(config: Config, overrides: Sequence[str]) -> Config:
    """A new config with the fields that `--config.FIELD=VALUE` arguments name. Raises ConfigError."""
    known = field_names(config)
    for argument in overrides:
        match = _OVERRIDE.match(argument)
        if argument.startswith("-") and not match:
            raise ConfigError(f"{argument}: unknown argument; fields of the config are set by --config.FIELD=VALUE")
        if match and match[1] not in known:
            raise ConfigError(unknown_field(f"--config.{match[1]}", [f"--config.{name}" for name in known]))
    values = flags.FlagValues()
    arguments = ["hcp_jax", *overrides]
    config_flags.DEFINE_config_dict("config", ConfigDict(to_dict(config)), flag_values=values, sys_argv=arguments)
    try:
        rest = values(arguments)
    except (flags.Error, ValueError, TypeError, KeyError, AttributeError, SyntaxError) as error:
        raise ConfigError(one_line(error)) from error
    if len(rest) > 1:
        raise ConfigError(f"{rest[1]}: unexpected argument")
    return from_dict(Config, values.config.to_dict())

"""Pages of the site that are written by nobody: mkdocs runs this file as a hook.

The home page is README.md, that of the robots `robots/README.md`, the configuration reference follows from the dataclasses in
`hcp_jax/config/`, and the figures and tables under `results/` are published beside the pages that point to them.
"""

import dataclasses
import inspect
import pathlib
import re
import types
import typing

from hcp_jax import presets
from hcp_jax.config import Config, DDPGConfig, HopperConfig, PPOConfig

ROOT = pathlib.Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "hcp_jax"
RESULTS = ("*.json", "*.png", "*/*.json", "*/*.png", "*/evaluations/*.json")
_ENTRY = re.compile(r"    (\w+(?:, \w+)*): (.*)")  # of a docstring's Attributes
_CONTINUED = re.compile(r"        +(.*)")
_INTRODUCTION = """# Configuration

Every field of an experiment's config, with its type, its default and what its dataclass says of it. This page is generated
from `hcp_jax/config/` and `hcp_jax/hardware/ranges.py` whenever the site is built.

A field is set on the command line by its dotted path, for instance `--config.ppo.learning_rate=1e-4`; an unknown field, a
value of another type and a value outside what is allowed end the command with one line and exit code 2. An experiment file
under `experiments/` returns one `Config`, and `config.json` in a run folder holds all of its fields.
"""


def on_config(config):
    """mkdocs asks here for its settings: a page of the API for every part of the package joins those in `nav`."""
    config.nav.append({"API": [{name: f"api/{name}.md"} for name in api_pages()]})
    return config


def on_files(files, config):
    """mkdocs asks here for the files of the site."""
    from mkdocs.structure.files import File  # the pages can be made without mkdocs

    robots = (ROOT / "robots" / "README.md").read_text()
    pages = {"index.md": home_page(), "configuration.md": configuration_page(), "robots.md": robots}
    pages |= {f"api/{name}.md": page for name, page in api_pages().items()}
    for name, page in pages.items():
        files.append(File.generated(config, name, content=page))
    for path in sorted(path for pattern in RESULTS for path in (ROOT / "results").glob(pattern)):
        files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown, **_):
    """mkdocs asks here for the text of each page."""
    return point_into_site(markdown)


def point_into_site(text: str) -> str:
    """A page's text whose links, which hold in a checkout, lead to the site's own pages and to the results beside them."""
    places = {"](../README.md": "](index.md", "](../robots/README.md": "](robots.md", "](../results/": "](results/"}
    for there, here in places.items():
        text = text.replace(there, here)
    return re.sub(r"\]\(\.\./hcp_jax/(\w+)\)", r"](api/\1.md)", text.replace("](../hcp_jax/config)", "](configuration.md)"))


def home_page() -> str:
    """README.md, whose links start at the repository's root."""
    return (ROOT / "README.md").read_text().replace("](docs/", "](").replace("](robots/README.md", "](robots.md")


def api_pages() -> dict[str, str]:
    """A page for each subpackage, and one for the modules beside them that are no commands; mkdocstrings fills them."""
    parts = {"hcp_jax": [path for path in sorted(PACKAGE.glob("*.py")) if "def main(" not in path.read_text()]}
    parts |= {folder.parent.name: sorted(folder.parent.glob("*.py")) for folder in sorted(PACKAGE.glob("*/__init__.py"))}
    return {name: f"# {name}\n\n{''.join(map(_reference, paths))}" for name, paths in parts.items()}


def configuration_page() -> str:
    """A section for every dataclass that a `Config` can hold, and what the presets change."""
    sections = [_describe(kind, path) for kind, path in find_dataclasses(Config).items()]
    return "\n".join([_INTRODUCTION, *sections, _describe_presets()])


def find_dataclasses(kind: type, path: str = "") -> dict[type, str]:
    """`kind` and every dataclass that its fields can hold, with the dotted path to it."""
    found = {kind: path}
    for name, hint in typing.get_type_hints(kind).items():
        for part in _alternatives(hint):
            if dataclasses.is_dataclass(part):
                found |= find_dataclasses(part, f"{path}{name}.")
    return found


def read_attributes(kind: type) -> tuple[str, dict[str, str]]:
    """A class's docstring without its Attributes, and what these say of each field."""
    text, _, listed = inspect.getdoc(kind).partition("\nAttributes:\n")
    meanings: dict[str, str] = {}
    names: list[str] = []
    for line in listed.splitlines():
        if match := _ENTRY.fullmatch(line):
            names = match[1].split(", ")
            meanings |= dict.fromkeys(names, match[2])
        elif match := _CONTINUED.fullmatch(line):
            meanings |= {name: f"{meanings[name]} {match[1]}" for name in names}
    return text.strip(), meanings


def _reference(path: pathlib.Path) -> str:
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return "" if path.name == "__init__.py" else f"::: {module}\n\n"


def _describe(kind: type, path: str) -> str:
    text, meanings = read_attributes(kind)
    hints, rows = typing.get_type_hints(kind), []
    for field in dataclasses.fields(kind):
        parts = [part for part in _alternatives(hints[field.name]) if dataclasses.is_dataclass(part)]
        meaning = meanings.get(field.name) or " or ".join(_link(part) for part in parts)
        rows.append([f"`{path}{field.name}`", _type_name(hints[field.name]), _default(field), meaning])
    heads = ["field", "type", "default", "meaning"]
    if not any(row[3] for row in rows):  # of a dataclass whose text says it all
        heads, rows = heads[:3], [row[:3] for row in rows]
    return f"## {kind.__name__}\n\n{text}\n\n{_table(heads, rows)}"


def _describe_presets() -> str:
    """What the presets `fast` change of the dataclasses' defaults, which are the preset `paper`."""
    rows = []
    for task, path, paper, fast in (
        ("hopper", "env", HopperConfig(), presets.FAST_HOPPER),
        ("hopper", "ppo", PPOConfig(), presets.FAST_PPO),
        ("reacher", "ddpg", DDPGConfig(), presets.FAST_DDPG),
        ("peg_insertion", "ddpg", DDPGConfig(), presets.FAST_PEG_DDPG),
    ):
        for field in dataclasses.fields(fast):
            before, after = getattr(paper, field.name), getattr(fast, field.name)
            if before != after and field.name != "preset":
                rows.append([task, f"`{path}.{field.name}`", f"`{before!r}`", f"`{after!r}`"])
    small = ", ".join(f"`ddpg.{name}` {value}" for name, value in presets.SMALL_BATCHES.items())
    text = (
        "The experiments use the preset `fast`; `hcp_jax/presets.py` says why it differs from the paper's values. The "
        f"reacher with aligned joints and `experiments/finetune.py` train in small batches: {small}."
    )
    return f"## Presets\n\n{text}\n\n{_table(['task', 'field', 'paper', 'fast'], rows)}"


def _alternatives(hint) -> tuple:
    return typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)


def _type_name(hint) -> str:
    names = [_link(part) if dataclasses.is_dataclass(part) else f"`{_plain(part)}`" for part in _alternatives(hint)]
    return " or ".join(names)


def _plain(hint) -> str:
    return hint.__name__ if isinstance(hint, type) and not typing.get_args(hint) else str(hint)


def _link(kind: type) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


def _default(field: dataclasses.Field) -> str:
    if field.default is dataclasses.MISSING:
        return "required"
    return f"`{type(field.default).__name__}()`" if dataclasses.is_dataclass(field.default) else f"`{field.default!r}`"


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)

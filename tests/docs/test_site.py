"""The documentation: its generated pages, and that mkdocs builds it without a warning."""

import dataclasses
import importlib
import importlib.util
import pathlib
import re
import shlex
import subprocess
import sys

import pytest

from hcp_jax import command_line
from hcp_jax.config import Config, DDPGConfig, field_names
from hcp_jax.presets import FAST_DDPG, arm, hopper

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.fixture(scope="module")
def pages():
    """docs/generated_pages.py, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("generated_pages", ROOT / "docs" / "generated_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rows(pages) -> dict[str, list[list[str]]]:
    """Cells of the configuration page's rows, by their first one."""
    lines = [line for line in pages.configuration_page().splitlines() if line.startswith("| `")]
    found: dict[str, list[list[str]]] = {}
    for line in lines:
        cells = line.strip("| ").split(" | ")
        found.setdefault(cells[0].strip("`"), []).append(cells)
    return found


def test_the_configuration_page_names_every_field_of_hopper_and_arm(rows):
    expected = {*field_names(hopper("a", "none")), *field_names(arm("a", "reacher", "none"))}
    assert not expected - rows.keys()
    nested = {field.name for field in dataclasses.fields(Config)} | {"pool.ranges", "pool.chain_ranges"}
    assert not rows.keys() - expected - nested, "a field that no config has"


def test_every_field_but_those_of_ranges_has_a_meaning(rows):
    for name, found in rows.items():
        for cells in found:
            assert name.startswith("pool.ranges.") or (len(cells) == 4 and cells[3].strip()), name


def test_a_row_holds_type_default_and_the_docstrings_text(rows):
    assert rows["ddpg.buffer_episodes"][0] == [
        "`ddpg.buffer_episodes`",
        "`int`",
        f"`{DDPGConfig().buffer_episodes}`",
        "capacity of the replay buffer (paper: 1e6 steps, 5000 episodes of 200).",
    ]
    assert rows["ppo.gae_lambda"][0][3] == "discount and trace decay per control step."
    assert rows["name"][0][2] == "required"
    assert "up to 0.15 m above it" in rows["env.approach_starts"][0][3], "text that goes on in the next line"


def test_presets_are_listed_where_they_differ(pages):
    page = pages.configuration_page().partition("## Presets")[2]
    assert f"| reacher | `ddpg.batch_size` | `{DDPGConfig().batch_size}` | `{FAST_DDPG.batch_size}` |" in page
    assert "`ppo.num_epochs`" not in page, "the same in both"


def test_a_field_without_text_is_seen(pages):
    @dataclasses.dataclass(frozen=True)
    class Sample:
        """A sample.

        Attributes:
            first: one | two,
                and three.
        """

        first: int = 1
        second: float = 2.0

    text, meanings = pages.read_attributes(Sample)
    assert text == "A sample."
    assert meanings == {"first": "one | two, and three."}


def test_every_field_that_a_page_sets_exists():
    known = {*field_names(hopper("a", "none")), *field_names(arm("a", "reacher", "none"))}
    for page in PAGES:
        for name in re.findall(r"--config\.([\w.]+)=", page.read_text()):
            assert name in known or name == "FIELD", f"{page.name}: --config.{name}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_of_a_page_leads_somewhere_in_a_checkout(page):
    headings = {path: set(map(anchor, re.findall(r"^#+ (.*)", path.read_text(), re.MULTILINE))) for path in PAGES}
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if not link.startswith("http"):
            path, _, heading = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            assert target.exists(), link
            assert not heading or heading in headings[target], link


def anchor(heading: str) -> str:
    """What a heading is called in links, on GitHub and on the site."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def test_links_of_a_checkout_lead_to_the_sites_own_pages(pages):
    text = "[a](../README.md#b) [c](../results/d.json) [e](../hcp_jax/config) [f](../hcp_jax/policies) [g](../robots/README.md)"
    expected = "[a](index.md#b) [c](results/d.json) [e](configuration.md) [f](api/policies.md) [g](robots.md)"
    assert pages.point_into_site(text) == expected


class Parsed(Exception):
    """Raised in place of a command's work; its argument is what the parser left."""


def commands_in_pages() -> list[tuple[str, str, str]]:
    """(page, module, arguments) of every command of ours, in blocks and in running text."""
    found = []
    for page in PAGES:
        text = page.read_text().replace("\\\n", " ")
        found += [(page.name, *match) for match in re.findall(r"python -m (hcp_jax\.\w+)([^`#\n]*)", text)]
    return found


def test_every_command_in_the_pages_is_one_that_its_parser_takes(monkeypatch):
    parse = command_line.OneLineParser.parse_known_args

    def stop(parser, arguments=None, namespace=None):
        raise Parsed(parse(parser, arguments, namespace)[1])

    monkeypatch.setattr(command_line.OneLineParser, "parse_known_args", stop)
    commands = commands_in_pages()
    assert len(commands) > 20
    for page, module, arguments in commands:
        if not re.match(r"\s*(--help|[A-Z]+\b)", arguments):  # of which a page shows no more than its form
            with pytest.raises(Parsed) as parsed:
                importlib.import_module(module).main(shlex.split(arguments))
            assert all(word.startswith("--config.") for word in parsed.value.args[0]), f"{page}: {module}{arguments}"


def test_the_site_builds_without_a_warning(tmp_path):
    for name in ("mkdocs", "material", "mkdocstrings"):
        pytest.importorskip(name, reason="the site needs the extra `docs`")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for page in ("", "configuration/", "api/hardware/", "your_robot/"):
        assert (tmp_path / page / "index.html").exists()
    assert "ddpg.critic_weight_decay" in (tmp_path / "configuration" / "index.html").read_text()
    assert "make_hopper_pool" in (tmp_path / "api" / "hardware" / "index.html").read_text()

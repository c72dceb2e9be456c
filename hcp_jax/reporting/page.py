"""The report's page: what it is made of, and its HTML."""

import dataclasses

import jinja2

GENERATOR = "hcp_jax.report"  # that wrote a page, in its head


@dataclasses.dataclass(frozen=True)
class Figure:
    """A picture: its data URI, what is written below it and the files it shows."""

    uri: str
    caption: str
    sources: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class Row:
    """Cells of a table; `kind` is `missing`, `paper`, `difference` or nothing special."""

    cells: tuple[str, ...]
    kind: str = ""


@dataclasses.dataclass(frozen=True)
class Table:
    """Columns with a letter for each: l for text, r for numbers, c for code."""

    caption: str
    columns: tuple[str, ...]
    align: str
    rows: tuple[Row, ...]
    sources: tuple[str, ...] = ()

    def __post_init__(self):
        if any(len(row.cells) != len(self.columns) for row in self.rows) or len(self.align) != len(self.columns):
            raise ValueError(f"table {self.caption!r}: rows, columns and alignment differ in length")


@dataclasses.dataclass(frozen=True)
class Item:
    """Something that a reader may want to recompute. Without tables and figures it is shown as not run."""

    title: str
    text: str = ""
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    commands: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class Section:
    """A part of the page, with its name in links."""

    name: str
    title: str
    items: tuple[Item, ...]
    text: str = ""


def write_page(title: str, introduction: str, sections: tuple[Section, ...]) -> str:
    """The whole page as HTML that loads nothing."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("hcp_jax.reporting", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    template = environment.get_template("page.html.jinja")
    return template.render(title=title, introduction=introduction, sections=sections, generator=GENERATOR)

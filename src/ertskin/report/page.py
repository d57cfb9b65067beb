"""What a report page is made of, and its rendering into one file that needs nothing outside itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import jinja2
from matplotlib.figure import Figure

from ertskin.files import write_whole
from ertskin.report.figures.image import data_uri, png

TEMPLATE = Path(__file__).parent / "templates" / "report.html.j2"


@dataclass(frozen=True)
class Picture:
    """A picture as a ``data:`` address, and its caption; ``wide`` ones take the whole width of the page."""

    uri: str
    caption: str
    wide: bool = False

    @classmethod
    def of(cls, figure: Figure, caption: str, wide: bool = False) -> Picture:
        """A figure just drawn."""
        return cls(data_uri(png(figure)), caption, wide)


@dataclass(frozen=True)
class Row:
    """One line of a table: its cells as (main text, small text below); ``mark`` names its look in the page."""

    cells: tuple[tuple[str, str], ...]
    mark: str = ""


@dataclass(frozen=True)
class Table:
    """Column heads, lines, and a caption that says how to read them."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """A heading, what it says in words, facts as (name, value), commands to copy, tables, pictures, in this order."""

    title: str
    words: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    commands: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Page:
    """Title, a summary of a few lines with the key numbers as (value, meaning), then the sections."""

    title: str
    summary: str
    key_numbers: tuple[tuple[str, str], ...] = ()
    sections: tuple[Section, ...] = ()
    footer: tuple[str, ...] = field(default=())


def render(page: Page) -> str:
    """The page as HTML; every text is escaped."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(page=page)


def write_page(path: Path, page: Page) -> Path:
    """Render ``page``, write it aside and rename it to ``path``."""
    return write_whole(path, render(page))

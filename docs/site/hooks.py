"""What the pages take from the code when the site is built: tables, and equations as MathML, which needs no script."""

from __future__ import annotations

import html
import re
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert

sys.path.insert(0, str(Path(__file__).parent))
from tables import TABLES

MARKER = re.compile(r"<!-- table: (\w+) -->")
EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put a table wherever a page names one."""
    return MARKER.sub(lambda found: TABLES[found.group(1)](), markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Put MathML in place of TeX."""
    return EQUATION.sub(_mathml, content)


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found.group(2) == "[" else "inline"
    return convert(html.unescape(found.group(3)).strip(), display=display)

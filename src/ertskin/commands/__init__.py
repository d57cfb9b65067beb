"""The verbs of the command line, one module each.

A module ``NAME.py`` with a docstring and a function ``run(config)``, beside a configuration ``conf/NAME.yaml``, is the
command ``ertskin NAME``: there is no other list to keep.
"""

from __future__ import annotations

import ast
from pathlib import Path

# The order a person works in; a verb that isn't named here comes after them.
ORDER = (
    "run",
    "doctor",
    "import",
    "record",
    "calibrate",
    "synthesize",
    "train",
    "evaluate",
    "diagnose",
    "live",
    "dashboard",
)


def verbs() -> dict[str, str]:
    """Name -> docstring of every command, read without importing any of them."""
    found = {
        path.stem: ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        for path in Path(__file__).parent.glob("[a-z]*.py")
    }
    return {name: found[name] for name in sorted(found, key=_order)}


def _order(name: str) -> tuple[int, str]:
    return (ORDER.index(name) if name in ORDER else len(ORDER), name)

"""Functions of the diagnosis stay short enough to be read at once."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from ertskin import diagnosis

MOST_LINES, MOST_BRANCHES = 40, 10
FOLDER = Path(diagnosis.__path__[0])
LONG = {"judge/answer.py": {"answered"}, "rest/baseline.py": {"calibrated"}}
"""Still longer than that; none may join them."""
BRANCHES = ast.If | ast.For | ast.While | ast.ExceptHandler | ast.match_case
MODULES = sorted(path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*.py"))


@pytest.mark.parametrize("module", MODULES)
def test_functions_are_short(module: str) -> None:
    tree = ast.parse((FOLDER / module).read_text(encoding="utf-8"))
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        if function.name in LONG.get(module, ()):
            continue
        assert function.end_lineno is not None
        assert function.end_lineno - function.lineno < MOST_LINES, function.name
        assert sum(isinstance(node, BRANCHES) for node in ast.walk(function)) <= MOST_BRANCHES, function.name

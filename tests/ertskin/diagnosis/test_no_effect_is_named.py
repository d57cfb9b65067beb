"""An effect is one file: nothing outside it knows it by name or by class."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import ertskin.physics
from ertskin import diagnosis
from ertskin.physics.effects.registry import effect_classes

MODULES = [
    path
    for package in (diagnosis, ertskin.physics)
    for path in sorted(Path(package.__path__[0]).rglob("*.py"))
    if path.parent.name != "effects"
]
CLASSES = {kind.__name__ for kind in effect_classes().values()}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_no_module_names_an_effect(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = {
        alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom | ast.Import) for alias in node.names
    }
    spelt = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert not imported & CLASSES
    assert not used & CLASSES
    assert not spelt & set(effect_classes())

"""Text files of columns, with or without a line of names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ertskin.errors import UserError

SEPARATORS = (",", ";", "\t")


def read_csv(path: Path) -> dict[str, Any]:
    """Columns by name, or by number as ``c0``, ``c1`` where the first line holds numbers; lines after # are left out.

    An empty cell is NaN. Raises ``UserError`` where a line has more or fewer columns, or a cell is no number.
    """
    lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.split("#")[0].strip()]
    if not lines:
        raise UserError(f"{path}: holds no line")
    separator = max(SEPARATORS, key=lines[0].count)
    first = [cell.strip().strip('"') for cell in lines[0].split(separator)]
    named = not all(_is_number(cell) for cell in first)
    names = first if named else [f"c{k}" for k in range(len(first))]
    try:
        rows = np.genfromtxt(lines[named:], delimiter=separator, comments="#", ndmin=2, dtype=float)
    except ValueError as error:
        raise UserError(f"{path}: {' '.join(str(error).split())}") from None
    if rows.shape[1] != len(names):
        raise UserError(f"{path}: its lines have {rows.shape[1]} columns, the first one names {len(names)}")
    return {name: rows[:, k] for k, name in enumerate(names)}


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True

"""What a file holds, by name: numbers as arrays, structures by dotted names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ertskin.errors import UserError
from ertskin.importing.csv_file import read_csv
from ertskin.importing.mat_file import read_mat
from ertskin.importing.npz_file import read_npz

READERS: dict[str, Callable[[Path], dict[str, Any]]] = {
    ".npz": read_npz,
    ".npy": read_npz,
    ".mat": read_mat,
    ".csv": read_csv,
    ".tsv": read_csv,
    ".txt": read_csv,
}
"""A reader gives nested dictionaries, lists of them for an array of structures, and numpy arrays at the leaves."""


def read_variables(path: Path) -> dict[str, Any]:
    """The file's variables, structures as dictionaries; raises ``UserError`` for a file that can't be read."""
    if path.suffix.lower() not in READERS:
        raise UserError(f"{path}: can't import '{path.suffix}' files: one of {', '.join(READERS)} is needed")
    if not path.is_file():
        raise UserError(f"{path}: no such file to import")
    try:
        return READERS[path.suffix.lower()](path)
    except UserError:
        raise
    except Exception as error:
        # Each format's library raises classes of its own for each way a file can be bad.
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise UserError(f"{path}: can't be read as {path.suffix[1:].upper()}: {reason}") from None


def flattened(variables: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted names to leaves; arrays of structures stay lists."""
    flat: dict[str, Any] = {}
    for name, value in variables.items():
        flat |= flattened(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat


def described(variables: dict[str, Any]) -> list[str]:
    """A line for every variable: its name, shape and kind."""
    lines = []
    for name, value in flattened(variables).items():
        if isinstance(value, np.ndarray):
            shape = " x ".join(map(str, value.shape)) or "one number"
            lines.append(f"{name}: {shape}, {value.dtype}")
        elif isinstance(value, list):
            fields = f" with {', '.join(value[0])}" if value and isinstance(value[0], dict) else ""
            lines.append(f"{name}: {len(value)} structures{fields}")
        else:
            lines.append(f"{name}: {value!r}")
    return lines

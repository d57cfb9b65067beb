"""One entry of a mapping: a value written there, or taken from a file."""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.importing.variables import flattened, read_variables

Array = NDArray[np.float64]
KEYS = {"from", "file", "scale", "offset", "axes"}


@dataclass
class Source:
    """The file imported, and others that entries name; each is read once. ``mapping`` is named in errors."""

    path: Path
    mapping: Path
    _read: dict[Path, dict[str, Any]] = field(default_factory=dict)

    def variables(self, path: Path | None = None) -> dict[str, Any]:
        """Nested variables of the file, or of another one."""
        path = path or self.path
        if path not in self._read:
            self._read[path] = read_variables(path)
        return self._read[path]

    def refuse(self, where: str, reason: str) -> UserError:
        """The error to raise about the entry at ``where``."""
        return UserError(f"{self.mapping}: {where}: {reason}")

    def value(self, entry: Any, where: str) -> Any:
        """What an entry stands for: itself, or an array where it says ``from``; lists and tables entry by entry."""
        if isinstance(entry, dict) and "from" in entry:
            return self._taken(entry, where)
        if isinstance(entry, dict):
            return {key: self.value(item, f"{where}.{key}") for key, item in entry.items()}
        return entry

    def _taken(self, entry: dict[str, Any], where: str) -> Array:
        if unknown := set(entry) - KEYS:
            raise self.refuse(where, f"unknown {', '.join(sorted(unknown))}; there are {', '.join(sorted(KEYS))}")
        path = self.path if "file" not in entry else self.path.parent / str(entry["file"])
        wanted = entry["from"] if isinstance(entry["from"], list) else [entry["from"]]
        found = [self._found(str(name), path, where) for name in wanted]
        columns = [array for arrays in found for array in arrays]
        if len({array.shape for array in columns}) > 1:
            shapes = ", ".join(str(array.shape) for array in columns)
            raise self.refuse(where, f"the variables of {entry['from']} have different shapes: {shapes}")
        array = columns[0] if len(columns) == 1 else np.stack(columns, axis=-1)
        if "axes" in entry:
            if sorted(entry["axes"]) != list(range(array.ndim)):
                raise self.refuse(where, f"axes {entry['axes']} don't order the {array.ndim} axes of {array.shape}")
            array = array.transpose(entry["axes"])
        return float(entry.get("scale", 1.0)) * array + float(entry.get("offset", 0.0))

    def _found(self, name: str, path: Path, where: str) -> list[Array]:
        """The variable of this name, or all that fit a pattern, in the file's order."""
        known = flattened(self.variables(path))
        names = [name] if name in known else [other for other in known if fnmatchcase(other, name)]
        if not names:
            raise self.refuse(where, f"{path.name} has no '{name}'; it has {', '.join(known) or 'nothing'}")
        arrays = []
        for one in names:
            if not isinstance(known[one], np.ndarray) or known[one].dtype.kind not in "fiub":
                raise self.refuse(where, f"'{one}' of {path.name} holds no numbers")
            arrays.append(np.asarray(known[one], dtype=float))
        return arrays

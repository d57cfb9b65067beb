"""NPZ and NPY files of numpy; nothing in them is executed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np


def read_npz(path: Path) -> dict[str, Any]:
    """Arrays by name; that of an NPY file is called ``array``."""
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return {"array": loaded}
    with loaded:
        return {name: loaded[name] for name in loaded.files}

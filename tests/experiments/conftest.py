"""The proof's scripts and its generator on the path of the tests that import them."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "concealed" / "proof"))

"""Findings about a partial recording, which bring figures of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ertskin.diagnosis.judge.result import Findings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawing = tuple[str, str, Callable[[], "Figure"]]
"""Title, caption, what draws it."""


@dataclass(frozen=True, eq=False)
class DrawnFindings(Findings):
    """An answer with the figures that show it."""

    drawings: tuple[Drawing, ...] = ()

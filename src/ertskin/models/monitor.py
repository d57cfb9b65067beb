"""What goes along with a network to tell whether the skin still is as it was trained for, and to follow it at rest."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ertskin.models.novelty import Novelty
from ertskin.physics.calibration.following import RestingSkin


@dataclass(frozen=True, eq=False)
class SkinMonitor:
    """``resting``: the untouched skin at its calibration and how it wanders. ``novelty``: scores of touched frames."""

    resting: RestingSkin
    novelty: Novelty

    def held(self) -> dict[str, Any]:
        """Arrays by name, as files keep them."""
        return {
            f"{part}.{field.name}": np.asarray(getattr(getattr(self, part), field.name))
            for part, kind in _PARTS.items()
            for field in fields(kind)
        }

    @classmethod
    def of(cls, held: dict[str, Any]) -> SkinMonitor | None:
        """The monitor among arrays by name, None where there is none of it."""
        if "resting.rest_v" not in held:
            return None
        parts = [
            kind(**{field.name: _array_or_float(held[f"{part}.{field.name}"]) for field in fields(kind)})
            for part, kind in _PARTS.items()
        ]
        return cls(*parts)


_PARTS: dict[str, type[Any]] = {"resting": RestingSkin, "novelty": Novelty}


def _array_or_float(value: Any) -> Any:
    array = np.asarray(value)
    return array if array.ndim else float(array)

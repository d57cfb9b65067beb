"""What a diagnosis is to improve on: the simulator without effects, calibrated as far as it came."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis import skin
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis


def solved(size: float, *effects: object) -> Any:
    return SimpleNamespace(effects=effects, scan_residual=np.full((3, 4), size), size=size)


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (solved(1.12), solved(1.0), 1.0),
        (solved(1.0), solved(1.1), 1.0),
        (solved(3.0), solved(1.0, PiezoHysteresis(width=0.1)), 3.0),
    ],
    ids=["further on", "worse for it", "named"],
)
def test_the_better_calibration_without_effects_counts(before: Any, after: Any, expected: float) -> None:
    selection: Any = SimpleNamespace(before=before, after=after)
    nothing: Any = None
    assert skin._uncorrected(nothing, nothing, nothing, nothing, selection).size == expected  # type: ignore[attr-defined]

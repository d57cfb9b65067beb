"""A specimen of a simulated skin's own pair on the virtual bench: its law, its memory, its creep, its noise."""

from __future__ import annotations

import numpy as np

from ertskin.hardware.virtual.bench.piezo import ClosingLaw, LogCreep, WedgeMemory
from ertskin.hardware.virtual.bench.truth import Truth


class BenchSpecimen:
    """Resistance under stress, step by step."""

    def __init__(self, truth: Truth) -> None:
        hysteresis, creep = truth.parameters("piezo_hysteresis"), truth.parameters("piezo_creep")
        self._law = ClosingLaw(**truth.law)
        self._wedge = WedgeMemory(**hysteresis) if hysteresis else None
        self._ladder = LogCreep(**creep) if creep else None
        self._lagging = self._wedge.start(()) if self._wedge else None
        self._crept = self._ladder.start(()) if self._ladder else None
        self._noise = truth.noise.specimen_share
        self._rng = truth.rng("specimen on the bench")
        self._time_s: float | None = None

    def resistance_ohm_sq(self, time_s: float, stress_pa: float) -> float:
        """Sheet resistance under a stress; calls come in time order."""
        felt = np.asarray(stress_pa)
        if self._wedge is not None and self._lagging is not None:
            self._lagging, felt = self._wedge.follow(self._lagging, felt)
        resistance = float(self._law.resistance_ohm(felt))
        if self._ladder is not None and self._crept is not None:
            passed = 0.0 if self._time_s is None else time_s - self._time_s
            self._crept = self._ladder.dwell(self._crept, felt, passed)
            resistance *= float(self._ladder.factor(self._crept))
        self._time_s = time_s
        return resistance * (1.0 + self._noise * float(self._rng.normal()))

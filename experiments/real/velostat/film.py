"""One recording of the film: which readings are under load, which presses are fitted and which held out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.recording import read_recording

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

FORCES_N = (5, 10, 20)
FITTED = 10
"""Presses that are fitted, of sixteen."""
PRESSES = 16
LOADED = 0.05
"""Stress over the recording's largest from which a reading counts as under load."""
MOST_READINGS = 1500
AIR = 0.005
"""Stress over the recording's largest below which nothing presses: the load cell's zero."""
KNOWN = 0.5
"""Part of a press's largest stress up to which its rise is what is known of the press beforehand."""


@dataclass(frozen=True, eq=False)
class Film:
    """Sixteen presses at one force: N readings of stress, resistance (unit not documented), time and press."""

    force_n: int
    stress_pa: Array
    resistance: Array
    time_s: Array
    press: NDArray[np.intp]

    @classmethod
    def read(cls, data: Path, force_n: int) -> Film:
        """``data``/real/velostat_``force_n``n.h5, evenly thinned."""
        test = read_recording(data / "real" / f"velostat_{force_n}n.h5").specimen
        assert test is not None
        step = max(1, len(test.stress_pa) // MOST_READINGS)
        stress, resistance = (
            np.asarray(v, dtype=float)[::step] for v in (test.stress_pa, test.sheet_resistance_ohm_sq)
        )
        stress[stress < AIR * stress.max()] = 0.0
        return cls(force_n, stress, resistance, test.time_s[::step], test.cycle[::step].astype(int))

    @property
    def log_resistance(self) -> Array:
        """(N,) natural logarithm of the resistance."""
        return np.asarray(np.log(self.resistance))

    @property
    def loaded(self) -> Rows:
        """(N,) readings under load."""
        return np.asarray(self.stress_pa > LOADED * self.stress_pa.max())

    @property
    def early(self) -> Rows:
        """(N,) readings of the presses that are fitted."""
        return np.asarray(self.press < FITTED)

    @property
    def rising(self) -> Rows:
        """(N,) readings of each press's rise up to ``KNOWN`` of its largest stress."""
        found = np.zeros(len(self.press), dtype=bool)
        for press in np.unique(self.press):
            mine = np.flatnonzero(self.press == press)
            stress = self.stress_pa[mine]
            first = int(np.argmax(stress > KNOWN * stress.max()))
            found[mine[: first + 1]] = True
        return found

"""Somebody to touch the virtual skin while it is watched: the rig's own stage, pressing here and there."""

from __future__ import annotations

import threading

import numpy as np

from ertskin.hardware.failure import InstrumentError
from ertskin.hardware.indenter import Indenter
from ertskin.hardware.rig import Rig

DEEPEST_M = 3.5e-3


class Hand:
    """Presses random taxels in a thread of its own until told to end; leaves the stage in the air."""

    def __init__(self, rig: Rig, seed: int, ending: threading.Event) -> None:
        self._rig = rig
        self._rng = np.random.default_rng(seed)
        self._ending = ending
        self._thread = threading.Thread(target=self._play, daemon=True)

    def start(self, after_s: float) -> None:
        """Begin to press after so many seconds."""
        self._after_s = after_s
        self._thread.start()

    def join(self) -> None:
        """Wait until the stage is in the air."""
        self._thread.join(60.0)

    def _play(self) -> None:
        indenter = Indenter(self._rig)
        try:
            self._rig.load_cell.identify()
            self._rig.stage.identify()
            self._rig.stage.home()
            indenter.zero()
            x, y, z = self._rig.geometry.origin_m
            place = self._rig.sensor.taxel_m[len(self._rig.sensor.taxel_m) // 2]
            indenter.above((float(place[0]), float(place[1])))
            if self._ending.wait(self._after_s):
                return
            indenter.approach((float(place[0]), float(place[1])))
            indenter.surface_z_m = indenter.touch_off(x + place[0], y + place[1], z + self._rig.limits.approach_m)
            while not self._ending.is_set():
                taxel = self._rig.sensor.taxel_m[int(self._rng.integers(0, len(self._rig.sensor.taxel_m)))]
                self._press(indenter, (float(taxel[0]), float(taxel[1])))
        except InstrumentError:
            indenter.retract()
        else:
            indenter.lift()

    def _press(self, indenter: Indenter, place: tuple[float, float]) -> None:
        depth = float(self._rng.uniform(0.3, 1.0)) * DEEPEST_M
        indenter.above(place)
        indenter.approach(place)
        for share in (0.4, 0.7, 1.0, 0.6):
            if self._ending.is_set():
                break
            indenter.press(place, share * depth, 2e-3)
            indenter.listen(0.8)
        indenter.lift()
        indenter.listen(1.0)

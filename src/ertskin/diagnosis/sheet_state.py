"""What the effects at hand make of the sheet as a whole: its tensor, its own field, where its pads lie."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from physics.effects.effect import ElectrodeEffect
from physics.effects.sheet_anisotropy import SheetAnisotropy
from physics.effects.sheet_inhomogeneity import SheetInhomogeneity
from physics.sensor import Sensor
from physics.skin import Skin

Array = NDArray[np.float64]


def tensor_of(effects: Sequence[object]) -> Array:
    """(3,) xx, xy and yy of the relative conductance tensor, of unit determinant."""
    for effect in effects:
        if isinstance(effect, SheetAnisotropy):
            return effect.tensor()
    return np.array([1.0, 0.0, 1.0])


def tensor_strength(effects: Sequence[object]) -> Array:
    """(2,) stretch along x and along the diagonal, noughts where the sheet is isotropic."""
    for effect in effects:
        if isinstance(effect, SheetAnisotropy):
            return np.array([effect.stretch_x, effect.stretch_diagonal])
    return np.zeros(2)


def log_field(effects: Sequence[object], position_m: Array, extent_m: Array) -> Array:
    """(N,) logarithm of the sheet's own relative resistance at positions (N,2)."""
    total = np.zeros(len(position_m))
    for effect in effects:
        if isinstance(effect, SheetInhomogeneity):
            total += effect.log_resistance(position_m, extent_m)
    return total


def displaced(skin: Skin) -> Sensor:
    """The sensor with its pads where the effects have put them."""
    sensor = skin.sensor
    for effect in skin.effects:
        if isinstance(effect, ElectrodeEffect):
            sensor = effect.geometry(sensor)
    return sensor


def pad_shifts(skin: Skin) -> Array:
    """(L,2) how far each pad lies from its nominal place, in metres."""
    nominal = np.zeros((skin.protocol.electrodes, 2))
    for effect in skin.effects:
        if effect.name == "electrode_displacement":
            nominal[effect.electrode] += (effect.dx_m, effect.dy_m)  # type: ignore[attr-defined]
    return nominal

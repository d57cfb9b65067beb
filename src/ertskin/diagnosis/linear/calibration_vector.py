"""Skins that differ in their calibration: one vector of numbers for what a calibration may move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ertskin.diagnosis.linear.sheet_state import displaced
from ertskin.physics.calibration.moduli import moduli_groups, with_moduli
from ertskin.physics.effects.effect import Effect
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.mechanics.radial_kernel import RadialKernel
from ertskin.physics.mechanics.stiffness import sensor_stiffness_n_per_m
from ertskin.physics.piezo.polynomial import CHECKED, PiezoPolynomial
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import Skin, lagrange_weights

Array = NDArray[np.float64]

SHAPE = 9
"""Chebyshev coefficients of the law that a fit may move: a law that is no fifth-order polynomial is no
physics left out."""
CONTACT_SPREAD = 2.0
"""Standard deviation of the logarithms of the contacts on one skin, beforehand: it keeps those in their place that the
readings hardly tell, as where driven electrodes aren't read."""
SIZE_STEPS = 2
WIDEST_RATIO = 2.5
"""How far the logarithm of the moduli's ratio may go: a foam twelve times as stiff as its data sheet says."""
RATIO_STEP = 0.5
"""Spacing in the logarithm of the moduli's ratio at which pressure fields are computed."""
POINTS = 4
"""Tabulated pressure fields that an interpolation uses."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a calibration fits, apart from the force stage.

    ``zero_ohm_sq`` unloaded sheet resistance; ``contact_ohm`` (L,); ``log_ratio`` logarithm of the foam's modulus over
    the rest of the pad's, against nominal; ``shape`` (SHAPE,) changes of the law's Chebyshev coefficients from 1 on.
    """

    zero_ohm_sq: float
    contact_ohm: Array
    log_ratio: float
    shape: Array

    def vector(self) -> Array:
        """(L+2+SHAPE,) numbers of order one step each: logarithms of resistances, ratio, coefficients."""
        return np.concatenate([[np.log(self.zero_ohm_sq)], np.log(self.contact_ohm), [self.log_ratio], self.shape])

    @classmethod
    def of(cls, vector: Array) -> Calibration:
        """The inverse of ``vector``."""
        electrodes = len(vector) - 2 - SHAPE
        return cls(
            float(np.exp(vector[0])),
            np.exp(vector[1 : 1 + electrodes]),
            float(vector[1 + electrodes]),
            np.asarray(vector[2 + electrodes :]),
        )


class SkinFamily:
    """Skins of one sensor for any calibration near a first one; the pressure field is tabulated over the moduli.

    ``resolution``: of a mesh made anew.
    """

    def __init__(self, skin: Skin, resolution: str) -> None:
        self.first, self.resolution = skin, resolution
        self._field: dict[int, InterfacePressure] = {}
        self._known: dict[float, InterfacePressure] = {}

    def pressure(self, log_ratio: float) -> InterfacePressure:
        """The pressure field for a ratio of moduli, interpolated in its logarithm between the nearest tabulated."""
        if log_ratio in self._known:
            return self._known[log_ratio]
        most = round(WIDEST_RATIO / RATIO_STEP)
        lowest = int(np.clip(np.floor(log_ratio / RATIO_STEP) - 1, -most, most - POINTS + 1))
        steps = [lowest + k for k in range(POINTS)]
        fields = [self._tabulated(step) for step in steps]
        weights = lagrange_weights(RATIO_STEP * np.array(steps, dtype=float), np.array([log_ratio]))[0]
        value = sum(w * f.kernel.value for w, f in zip(weights, fields, strict=True))
        slope = sum(w * f.kernel.slope for w, f in zip(weights, fields, strict=True))
        found = InterfacePressure(RadialKernel(fields[0].kernel.radius_m, value, slope), fields[0].points_m)
        self._known = {**dict(list(self._known.items())[-3:]), log_ratio: found}
        return found

    def _tabulated(self, step: int) -> InterfacePressure:
        if step not in self._field:
            sensor = stiffened(self.first.sensor, step * RATIO_STEP, self.first.pad_n_per_m)
            self._field[step] = InterfacePressure.from_transform(sensor)
        return self._field[step]

    def skin(self, calibration: Calibration, effects: Sequence[Effect]) -> Skin:
        """The skin with this calibration and these effects, on the first skin's mesh."""
        law = shaped(self.first.piezo, calibration.shape).scaled(calibration.zero_ohm_sq)
        return replace(
            self.first,
            pressure=self.pressure(calibration.log_ratio),
            piezo=law,
            contact_resistance_ohm=calibration.contact_ohm,
            effects=tuple(effects),
        )

    def remeshed(self, calibration: Calibration, effects: Sequence[Effect]) -> Skin:
        """The same on a mesh of its own where its electrodes are displaced."""
        skin = self.skin(calibration, effects)
        if displaced(skin).electrodes_as(skin.sensor):
            return skin
        built = Skin.build(
            skin.sensor,
            skin.protocol,
            skin.piezo,
            skin.contact_resistance_ohm,
            skin.support_n_per_m,
            skin.effects,
            self.resolution,
        )
        return replace(built, pressure=skin.pressure, pad_n_per_m=skin.pad_n_per_m)


def stiffened(sensor: Sensor, log_ratio: float, pad_n_per_m: float) -> Sensor:
    """The sensor with its foam's modulus times exp(log_ratio), all but the glue's scaled to the pad's stiffness.

    The glue's modulus is known (paper III-B), so the pressure field depends on the others' size as well as on their
    ratio; an unknown stiffness (NaN) leaves the size nominal.
    """
    groups = moduli_groups(sensor)
    nominal = {layer.name: layer.youngs_modulus_pa for layer in sensor.layers}
    moduli = np.array([nominal[names[0]] for names in groups.values()])
    moduli[0] *= np.exp(log_ratio)
    size = 1.0
    for _ in range(SIZE_STEPS if np.isfinite(pad_n_per_m) else 0):
        size *= pad_n_per_m / sensor_stiffness_n_per_m(with_moduli(sensor, groups, size * moduli))
    return with_moduli(sensor, groups, size * moduli)


def shaped(law: PiezoPolynomial, change: Array) -> PiezoPolynomial:
    """The law with its coefficients from 1 on changed and its value at zero stress kept."""
    coefficients = np.zeros(max(len(law.coefficients), 1 + len(change)))
    coefficients[: len(law.coefficients)] = law.coefficients
    coefficients[1 : 1 + len(change)] += change
    coefficients[0] += 1.0 - chebyshev.chebval(-1.0, coefficients)
    return replace(law, coefficients=coefficients)


def law_factors(law: PiezoPolynomial) -> tuple[Array, Array]:
    """A law over its value unpressed, from no pressure to its largest (K,), and its derivatives (K,SHAPE) by what
    ``shaped`` changes of it, in which it is linear."""
    coordinate = np.linspace(-1.0, 1.0, CHECKED)
    each = chebyshev.chebvander(coordinate, SHAPE)
    return np.asarray(chebyshev.chebval(coordinate, law.coefficients)), np.asarray((each - each[0])[:, 1:])

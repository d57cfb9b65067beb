"""What the effects at hand make of the sheet as a whole: its tensor, its own field, where its pads lie."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.effects.effect import ElectrodeEffect
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

EVEN = 1e-12
"""Change of a logarithm that is none but for rounding."""


@dataclass(frozen=True, eq=False)
class SheetState:
    """Untouched sheet at N points: conductance over the fabric's own, as a size times a tensor of unit determinant.

    ``log_size`` (N,) the size's logarithm; ``stretch`` (N,2) the tensor's along x and along the diagonal x = y: the
    tensor is the exponential of [[stretch_x, stretch_diagonal], [stretch_diagonal, -stretch_x]] / 2.
    """

    log_size: Array
    stretch: Array

    @classmethod
    def of(cls, skin: Skin, position_m: Array) -> SheetState:
        """What a skin's effects make of its sheet at positions (N,2)."""
        relative = skin.sheet_conductance_s(np.ones(len(position_m)), position_m)
        if relative.ndim == 1:
            return cls(np.log(relative), np.zeros((len(relative), 2)))
        size = np.sqrt(relative[:, 0] * relative[:, 2] - relative[:, 1] ** 2)
        along = np.stack([0.5 * (relative[:, 0] - relative[:, 2]), relative[:, 1]], axis=1) / size[:, None]
        odd = np.hypot(*along.T)
        stretch = 2 * np.arcsinh(odd) / np.where(odd > 0, odd, 1.0)
        return cls(np.log(size), np.where(odd[:, None] > 0, stretch[:, None] * along, 0.0))

    @cached_property
    def isotropic(self) -> bool:
        """Whether it conducts alike in all directions everywhere."""
        return not self.stretch.any()

    @cached_property
    def even_tensor(self) -> bool:
        """Whether the tensor is the same everywhere."""
        return bool((self.stretch == self.stretch[:1]).all())

    @cached_property
    def tensor(self) -> Array:
        """(N,3) xx, xy and yy of the tensor of unit determinant."""
        strength = np.hypot(*self.stretch.T)
        even, odd = np.cosh(strength / 2), 0.5 * np.sinc(0.5j * strength / np.pi).real
        return np.stack([even + odd * self.stretch[:, 0], odd * self.stretch[:, 1], even - odd * self.stretch[:, 0]], 1)

    def beyond(self, other: SheetState) -> SheetState:
        """The change from another state, to first order in the stretch; rounding is no change."""
        log_size, stretch = self.log_size - other.log_size, self.stretch - other.stretch
        return SheetState(*(np.where(np.abs(change) > EVEN, change, 0.0) for change in (log_size, stretch)))

    def shaped(self, conductance_s: Array) -> Array:
        """(E,Q) or, where it is anisotropic, (E,Q,3) conductance of the size (E,Q) in siemens, E*Q = N."""
        if self.isotropic:
            return conductance_s
        return conductance_s[..., None] * self.tensor.reshape(*conductance_s.shape, 3)

    @property
    def differs(self) -> bool:
        """Whether anything differs from an even isotropic sheet."""
        return bool(self.log_size.any() or self.stretch.any())


def displaced(skin: Skin) -> Sensor:
    """The sensor with its pads where the effects have put them."""
    moved = [effect for effect in skin.effects if isinstance(effect, ElectrodeEffect)]
    return reduce(lambda sensor, effect: effect.geometry(sensor), moved, skin.sensor)


def pad_shifts(skin: Skin) -> Array:
    """(L,2) how far each electrode lies from its nominal place, in metres."""
    return displaced(skin).electrode_middle_m - skin.sensor.electrode_middle_m

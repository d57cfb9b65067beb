"""The simulated skin as synthesis asks it: single presses, each after a rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from physics.conduction.sheet import Solution
from physics.effects.effect import ElectrodeEffect
from physics.skin import TAIL, Skin

Array = NDArray[np.float64]
Spot = tuple[NDArray[np.intp], Array]

_REMEMBERED = 256


@dataclass(eq=False)
class PressForward:
    """Presses on ``skin``, its effects included, that have lasted ``dwell_s`` since the skin was at rest.

    Only what a press changes is solved again. Press and rest are taken at the recording's time zero: drift over the
    recording has no part in a change.
    """

    skin: Skin
    dwell_s: float = 1.0
    _spots: dict[tuple[float, float], Spot] = field(default_factory=dict, repr=False)
    _base: tuple[Array, Solution] | None = field(default=None, repr=False)

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C), NaN for an absent one."""
        rest = self.rest[1].pair_resistance_ohm
        place = self.skin.contact_m(contact_m)
        return np.stack([self._pressed(p, f) - rest for p, f in zip(place, force_n, strict=True)])

    @property
    def rest(self) -> tuple[Array, Solution]:
        """Conductance (E*Q,) or (E*Q,3) of the untouched sheet and its solution."""
        if self._base is None:
            skin, size = self.skin, self.skin.sheet.weight_m2.size
            conductance = skin.sheet_conductance_s(np.zeros(size), skin.sheet.quadrature_m.reshape(-1, 2))
            contacts = skin.contact_resistances_ohm(np.zeros(1), np.zeros((1, skin.sheet.electrodes)))[0]
            self._base = conductance, skin.sheet.solve(self._shaped(conductance), contacts)
        return self._base

    def __getstate__(self) -> dict[str, object]:
        """Workers make their own caches."""
        return {**self.__dict__, "_spots": {}, "_base": None}

    def _pressed(self, place_m: Array, force_n: Array) -> Array:
        there = np.isfinite(place_m).all(axis=-1) & (np.nan_to_num(force_n) > 0)  # a cell in air reads a force too
        conductance, base = self.rest
        if not there.any():
            return base.pair_resistance_ohm
        points, pressure = self._pressure_pa(place_m[there], force_n[there])
        sheet = conductance.copy()
        sheet[points] = self._pressed_conductance_s(points, pressure)
        contacts = base.contact_resistance_ohm
        if self._contacts_respond:
            contacts = self._contacts_ohm(place_m[None], np.where(there, force_n, np.nan)[None])
        model, shaped = self.skin.sheet, self._shaped(sheet)
        if sheet.ndim == 1 and np.array_equal(contacts, base.contact_resistance_ohm):
            return model.solve_again(shaped, base).pair_resistance_ohm
        return model.solve(shaped, contacts).pair_resistance_ohm

    def _pressure_pa(self, place_m: Array, force_n: Array) -> tuple[NDArray[np.intp], Array]:
        """Quadrature points within reach of the contacts, and the pressure on them."""
        total = np.zeros(self.skin.sheet.weight_m2.size)
        reached = np.zeros(len(total), dtype=bool)
        spots = [self._spot(place) for place in place_m]
        for (points, unit), force in zip(spots, self.skin.felt_n(force_n), strict=True):
            total[points] += force * unit
            reached[points] = True
        points = np.flatnonzero(reached)
        return points, total[points]

    def _spot(self, place_m: Array) -> Spot:
        """Points within reach of a contact and their pressure per newton."""
        key = (float(place_m[0]), float(place_m[1]))
        if key not in self._spots:
            offset = self.skin.sheet.quadrature_m.reshape(-1, 2) - place_m
            points = np.flatnonzero((offset**2).sum(axis=1) < self._reach_m**2)
            self._spots[key] = points, self.skin.pressure.at(offset[points])
            if len(self._spots) > _REMEMBERED:
                del self._spots[next(iter(self._spots))]
        return self._spots[key]

    @cached_property
    def _reach_m(self) -> float:
        return self.skin.pressure.radius_m(TAIL)

    def _pressed_conductance_s(self, points: NDArray[np.intp], pressure_pa: Array) -> Array:
        """Conductance after ``dwell_s`` under a press that began from rest."""
        position = self.skin.sheet.quadrature_m.reshape(-1, 2)[points]
        course = np.stack([np.zeros_like(pressure_pa), pressure_pa, pressure_pa])
        effective = self.skin.effective_pressure_pa(course, position, np.array([0.0, 1e-3, self.dwell_s]))
        return self.skin.sheet_conductance_s(effective[-1], position)

    @cached_property
    def _contacts_respond(self) -> bool:
        return any(isinstance(effect, ElectrodeEffect) for effect in self.skin.effects)

    def _contacts_ohm(self, place_m: Array, force_n: Array) -> Array:
        pads = self.skin.pad_sample_m
        on_pads = self.skin.pressure_pa(pads.reshape(-1, 2), place_m, force_n).reshape(1, len(pads), -1).mean(axis=2)
        return self.skin.contact_resistances_ohm(np.zeros(1), on_pads)[0]

    def _shaped(self, conductance_s: Array) -> Array:
        return conductance_s.reshape(*self.skin.sheet.weight_m2.shape, *conductance_s.shape[1:])

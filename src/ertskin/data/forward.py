"""The simulated skin as synthesis asks it: single presses, each after a rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.sheet import Solution, transfer_of
from ertskin.physics.effects.effect import ElectrodeEffect
from ertskin.physics.protocol import pair_resistances
from ertskin.physics.skin import TAIL, Skin

Array = NDArray[np.float64]
Spot = tuple[NDArray[np.intp], Array]

_REMEMBERED = 256


@dataclass(eq=False)
class PressForward:
    """Presses on ``skin``, its effects included, that have lasted ``dwell_s`` since the skin was at rest.

    Only what a press changes is solved again. Press and rest are taken at the recording's time zero, of a sheet that is
    warmed through by its scans: drift over the recording has no part in a change.
    """

    skin: Skin
    dwell_s: float = 1.0
    _spots: dict[tuple[float, float], Spot] = field(default_factory=dict, repr=False)
    _rest: Solution | None = field(default=None, repr=False)

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C), NaN for an absent one."""
        if not len(contact_m):
            return np.zeros((0, len(self.rest.pair_resistance_ohm)))
        presses = zip(self.skin.contact_m(contact_m), force_n, strict=True)
        conductance = np.array([self._pressed(place, force).conductance_s for place, force in presses])
        return pair_resistances(transfer_of(conductance)) - self.rest.pair_resistance_ohm

    @property
    def rest(self) -> Solution:
        """The untouched sheet."""
        if self._rest is None:
            skin, (elements, points) = self.skin, self.skin.sheet.weight_m2.shape
            even = skin.resting_conductance_s.reshape(elements, points, *skin.resting_conductance_s.shape[1:])
            conductance = even * self._warmth.reshape(-1, *(1,) * (even.ndim - 1))
            contacts, _ = self._contacts(np.full((1, 2), np.nan), np.full(1, np.nan))
            self._rest = skin.sheet.solve(conductance, contacts)
        return self._rest

    def __getstate__(self) -> dict[str, object]:
        """Without what is quickly made again: the untouched sheet and the contacts' pressures."""
        return {**self.__dict__, "_spots": {}, "_rest": None}

    def _pressed(self, place_m: Array, force_n: Array) -> Solution:
        touching = np.isfinite(place_m).all(axis=-1) & (np.nan_to_num(force_n) > 0)  # a cell in air reads a force too
        if not touching.any():
            return self.rest
        elements, pressure = self._pressure_pa(place_m[touching], force_n[touching])
        conductance, model = self._pressed_conductance_s(elements, pressure), self.skin.sheet
        contacts, share = self.rest.contact_resistance_ohm, None
        if self._contacts_respond:
            contacts, share = self._contacts(place_m, np.where(touching, force_n, np.nan))
        if np.array_equal(contacts, self.rest.contact_resistance_ohm):
            return model.solve_part(elements, conductance, self.rest)
        sheet = self.rest.conductivity_s.copy()
        sheet[elements] = conductance
        return model.solve(sheet, contacts, share)

    def _pressure_pa(self, place_m: Array, force_n: Array) -> Spot:
        """Elements (n,) within reach of the contacts, and the pressure (n,Q) on them."""
        spots = [self._spot(place) for place in place_m]
        reached = np.zeros(len(self.skin.sheet.weight_m2), dtype=bool)
        for where, _ in spots:
            reached[where] = True
        elements = np.flatnonzero(reached)
        total = np.zeros((len(elements), self.skin.sheet.weight_m2.shape[1]))
        for (where, unit), force in zip(spots, self.skin.felt_n(force_n), strict=True):
            total[np.searchsorted(elements, where)] += force * unit
        return elements, total

    def _spot(self, place_m: Array) -> Spot:
        """Elements within reach of a contact and the pressure per newton on them."""
        key = (float(place_m[0]), float(place_m[1]))
        spot = self._spots.get(key)
        if spot is None:
            offset = self.skin.sheet.quadrature_m - place_m
            within = (offset**2).sum(axis=2) < self._reach_m**2
            elements = np.flatnonzero(within.any(axis=1))
            spot = elements, np.where(within[elements], self.skin.pressure.at(offset[elements]), 0.0)
            self._spots[key] = spot
            if len(self._spots) > _REMEMBERED:
                oldest, *_ = self._spots
                # Another thread may have done so meanwhile.
                self._spots.pop(oldest, None)
        return spot

    @cached_property
    def _reach_m(self) -> float:
        return self.skin.pressure.radius_m(TAIL)

    def _pressed_conductance_s(self, elements: NDArray[np.intp], pressure_pa: Array) -> Array:
        """(n,Q) or (n,Q,3) conductance after ``dwell_s`` under a press (n,Q) that began from rest."""
        position = self.skin.sheet.quadrature_m[elements].reshape(-1, 2)
        pressed = pressure_pa.ravel()
        course = np.stack([np.zeros_like(pressed), pressed, pressed])
        fabric = self.skin.fabric_ohm_sq(course, position, np.array([0.0, 1e-3, self.dwell_s]), np.array([2]))
        factor = self.skin.sheet_factor[elements]
        pressed_s = factor / fabric[0].reshape(*pressure_pa.shape, *(1,) * (factor.ndim - 2))
        return np.asarray(pressed_s * self._warmth[elements].reshape(-1, *(1,) * (factor.ndim - 1)))

    @cached_property
    def _warmth(self) -> Array:
        """(E,) factor on the elements' conductance by the warmth of a skin in use."""
        warmth = self.skin.warm_through(self.skin.sheet.quadrature_m.mean(axis=1))
        return np.ones(len(self.skin.sheet.weight_m2)) if warmth is None else np.exp(warmth)

    @cached_property
    def _contacts_respond(self) -> bool:
        return any(isinstance(effect, ElectrodeEffect) for effect in self.skin.effects)

    def _contacts(self, place_m: Array, force_n: Array) -> tuple[Array, Array | None]:
        """(L,) contact resistances in ohm under contacts (C,2), and what their cells conduct over the mean."""
        ohm, share = self.skin.contacts(np.zeros(1), place_m[None], force_n[None])
        return ohm[0], None if share is None else share[0]

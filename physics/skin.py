"""The forward chain: contacts and forces, interface pressure, sheet resistance, conduction, readings.

Every stage can carry effects (``ertskin.physics.effects``); without any this is the paper's multiphysics model (II).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.conduction.drifting import DriftedSheets
from ertskin.physics.conduction.sheet import Resolution, SheetModel, Solution
from ertskin.physics.contacts import contact_groups, frames_since, in_air, in_contact, memory_frames, within
from ertskin.physics.effects.effect import (
    AcquisitionEffect,
    Effect,
    ElectrodeEffect,
    FoamEffect,
    MotionEffect,
    PlacementEffect,
    SheetEffect,
)
from ertskin.physics.effects.piezo_chain import fabric_ohm_sq, in_fabric
from ertskin.physics.history import History
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.mechanics.reaction import foam_force_n
from ertskin.physics.mechanics.stiffness import sensor_stiffness_n_per_m
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]
Kind = TypeVar("Kind", bound=Effect)

TAIL = 2e-5
"""Pressure below this part of its peak is left out. On the paper's pad, at 10 N and 0.1 mA, that changes the 276
numbers by 0.06 of a 2 mV noise; ten times more left out would change them by half of it."""
UNCHANGED = 1e-5
"""Relative change of conductance, of what presses have left behind, below which there is none."""
TOGETHER = 2_000_000
"""Pressures, over times and points, held at once where the whole sheet's past is looked at."""
SKEW_NODES = 4
"""Moments within a scan at which a moving press is solved; the readings between follow by interpolation."""


@dataclass(frozen=True, eq=False)
class Skin:
    """A calibrated skin with its effects.

    ``contact_resistance_ohm`` (L,); ``support_n_per_m`` the stage's own stiffness in series with the pad's. The
    sensor's layers hold the fitted moduli, the piezoresistive law its fitted value at zero stress. ``pad_n_per_m`` is
    the linear pad's stiffness under the model indenter; only depth-driven forces need it.
    """

    sensor: Sensor
    protocol: Protocol
    sheet: SheetModel
    pressure: InterfacePressure
    piezo: PiezoPolynomial
    contact_resistance_ohm: Array
    support_n_per_m: float = np.inf
    effects: tuple[Effect, ...] = field(default=())
    pad_n_per_m: float = np.nan

    @classmethod
    def build(
        cls,
        sensor: Sensor,
        protocol: Protocol,
        piezo: PiezoPolynomial,
        contact_resistance_ohm: Array,
        support_n_per_m: float = np.inf,
        effects: Sequence[Effect] = (),
        resolution: str | Resolution = "fine",
        mechanics: str = "transform",
    ) -> Skin:
        """Mesh the sensor, displaced electrodes included, and tabulate its pressure field.

        ``mechanics`` names how the field is solved: the exact "transform" or the paper's "bricks".
        """
        real = reduce(lambda s, e: e.geometry(s), _of(effects, ElectrodeEffect), sensor)
        return cls(
            sensor,
            protocol,
            SheetModel(real, resolution),
            InterfacePressure.of(sensor, mechanics),
            piezo,
            np.asarray(contact_resistance_ohm, dtype=float),
            support_n_per_m,
            tuple(effects),
            sensor_stiffness_n_per_m(sensor),
        )

    def with_effects(self, effects: Sequence[Effect]) -> Skin:
        """The same skin with other effects; raises ``ValueError`` where they would move electrodes (build anew)."""
        if any(not e.geometry(self.sensor).electrodes_as(self.sensor) for e in _of(effects, ElectrodeEffect)):
            raise ValueError("displaced electrodes need another mesh: use Skin.build")
        return replace(self, effects=tuple(effects))

    # mechanics -----------------------------------------------------------------------------------------------------

    def force_n(self, history: History, depth_m: Array | None = None) -> Array:
        """(T,P) force in newton from the commanded depth (or from ``depth_m`` (T,P)), foam effects included."""
        foam_m = self.sensor.layers[0].thickness_m
        foam = _of(self.effects, FoamEffect)
        return foam_force_n(history, self.pad_n_per_m, self.support_n_per_m, foam_m, foam, depth_m)

    def contact_m(self, commanded_m: Array) -> Array:
        """(...,2) where the indenter really lands."""
        center = self.sensor.extent_m.mean(axis=0)
        return reduce(lambda c, e: e.contact_m(c, center), _of(self.effects, PlacementEffect), commanded_m)

    def felt_n(self, force_n: Array) -> Array:
        """(...,) force in newton that reaches the sheet as pressure, of forces (...,) on the indenter."""
        foam_m = self.sensor.layers[0].thickness_m if self.sensor.layers else np.nan
        return reduce(lambda f, e: e.felt_n(f, self.pad_n_per_m, foam_m), _of(self.effects, FoamEffect), force_n)

    def pressure_pa(self, position_m: Array, contact_m: Array, force_n: Array) -> Array:
        """(T,N) interface pressure at points (N,2) under forces (T,P) at true positions (T,P,2); NaN: no contact."""
        spots, share_n = self._spots(contact_m, force_n)
        unit = [self.pressure.at(position_m - spot) for spot in spots]
        return np.asarray(share_n @ np.reshape(unit, (len(spots), len(position_m))))

    def _spots(self, contact_m: Array, force_n: Array) -> tuple[Array, Array]:
        """Places (S,2) that are pressed, and the force (T,S) in newton that the sheet feels at each."""
        felt_n = self.felt_n(force_n)
        touching = in_contact(contact_m, felt_n)
        # As complex numbers places are sorted at once.
        known, number = np.unique(contact_m[touching] @ (1, 1j), return_inverse=True)
        spots = np.stack([known.real, known.imag], axis=-1)
        share_n = np.zeros((len(felt_n), len(spots)))
        np.add.at(share_n, (np.nonzero(touching)[0], number), felt_n[touching])
        return spots, share_n

    # piezoresistance -----------------------------------------------------------------------------------------------

    def fabric_ohm_sq(
        self, pressure_pa: Array, position_m: Array, time_s: Array, wanted: NDArray[np.intp] | None = None
    ) -> Array:
        """(n,N) ohm per square of the pressed fabric at the ``wanted`` times (all by default), before effects on the
        sheet; from pressures (T,N) in recording order at points (N,2)."""
        return fabric_ohm_sq(self.piezo, self.effects, pressure_pa, position_m, time_s, self.sensor.extent_m, wanted)

    def sheet_conductance_s(self, fabric_ohm_sq: Array, position_m: Array) -> Array:
        """(...,N), or (...,N,3) with anisotropy: conductance in siemens of a fabric of (...,N) ohm per square."""
        fabric_s = 1.0 / fabric_ohm_sq
        order = sorted(_of(self.effects, SheetEffect), key=lambda e: e.order)
        extent = self.sensor.extent_m
        return reduce(lambda s, e: e.conductivity_s(s, position_m, extent), order, fabric_s)

    @cached_property
    def sheet_factor(self) -> Array:
        """(E,Q) or (E,Q,3) what the effects on the sheet make of a fabric's conductance at its quadrature points."""
        elements, points = self.sheet.weight_m2.shape
        even = self.sheet_conductance_s(np.ones(elements * points), self.sheet.quadrature_m.reshape(-1, 2))
        return even.reshape(elements, points, *even.shape[1:])

    @cached_property
    def resting_conductance_s(self) -> Array:
        """(E*Q,) or (E*Q,3) conductance in siemens of the untouched sheet at its quadrature points."""
        untouched = self.piezo.sheet_resistance_ohm_sq(np.zeros(self.sheet.weight_m2.size))
        return self.sheet_conductance_s(untouched, self.sheet.quadrature_m.reshape(-1, 2))

    # electrodes ----------------------------------------------------------------------------------------------------

    def contacts(self, time_s: Array, contact_m: Array, force_n: Array) -> tuple[Array, Array | None]:
        """(T,L) contact resistances in ohm under forces (T,P) at true positions (T,P,2), and what each of the contacts'
        cells conducts over the mean of its contact (T,C); None for no contact that follows its pressure.

        What follows the pressure acts on contacts as the other effects leave them.
        """
        effects, model = _of(self.effects, ElectrodeEffect), self.sheet
        ohm = np.tile(np.asarray(self.contact_resistance_ohm, dtype=float), (len(time_s), 1))
        for effect in effects:
            if not effect.by_pressure:
                ohm = effect.contact_resistance_ohm(ohm, np.zeros_like(ohm), time_s)
        if not any(effect.by_pressure for effect in effects):
            return ohm, None
        pressure = self.pressure_pa(np.concatenate([c.center_m for c in model.contacts]), contact_m, force_n)
        share = np.ones(pressure.shape)
        for k, (contact, mine) in enumerate(zip(model.contacts, model.cells, strict=True)):
            pressed = pressure[:, mine].any(axis=1)
            spots = pressure[pressed, mine]
            mean = np.broadcast_to((spots @ contact.cell_size / contact.size)[:, None], spots.shape)
            cells = np.repeat(ohm[pressed, k, None], spots.shape[1], axis=1)
            for effect in effects:
                if effect.by_pressure:
                    felt = mean if getattr(effect, "evenly", False) else spots
                    cells = effect.contact_resistance_ohm(cells, felt, time_s[pressed])
            ohm[pressed, k] = contact.size / ((1.0 / cells) @ contact.cell_size)
            share[pressed, mine] = ohm[pressed, k, None] / cells
        return ohm, share

    # conduction ----------------------------------------------------------------------------------------------------

    def pair_resistance_ohm(
        self, history: History, force_n: Array | None = None, wanted: NDArray[np.intp] | None = None
    ) -> Array:
        """(n,P) pair resistances of the ``wanted`` frames (n,), in recording order, all T by default, P = L(L-1)/2.

        ``force_n`` (T,C) takes precedence over the history's; where neither is known the depth tells. Frames that are
        not wanted count as the past of those that are.
        """
        wanted = np.arange(len(history)) if wanted is None else wanted
        forces = self.known_force_n(history) if force_n is None else force_n
        contact = self.contact_m(history.contact_m)
        contacts, share = self.contacts(history.time_s[wanted], contact[wanted], forces[wanted])
        drift = self.drift(history.time_s)
        resting = self.resting_conductance_s
        drifted = None if self._tensor else DriftedSheets.of(self._resting, np.log(drift[wanted]))
        left = self._left_behind(history.time_s, contact, forces, wanted)
        warmth = self.warmth(self.sheet.quadrature_m.mean(axis=1), history.time_s, wanted)
        result = np.empty((len(wanted), self.protocol.electrodes * (self.protocol.electrodes - 1) // 2))
        for group in contact_groups(contact[wanted], forces[wanted]):
            points, conductance = self.pressed_conductance_s(history.time_s, contact, forces, wanted[group])
            for k, row in enumerate(group):
                sheet = resting.copy()
                if left is not None:
                    per_point = np.repeat(1 + left[row], self.sheet.weight_m2.shape[1])
                    sheet *= per_point if sheet.ndim == 1 else per_point[:, None]
                sheet[points] = conductance[k]
                if warmth is not None:
                    per_point = np.repeat(np.exp(warmth[row]), self.sheet.weight_m2.shape[1])
                    sheet *= per_point if sheet.ndim == 1 else per_point[:, None]
                cells = None if share is None else share[row]
                result[row] = self._solved(sheet, contacts[row], cells, drift[wanted[row]], drifted)
        return result

    def pressed_conductance_s(
        self, time_s: Array, contact_m: Array, force_n: Array, rows: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], Array]:
        """Quadrature points (n,) within reach of the contacts of frames ``rows`` (m,), which share them, and the
        conductance (m,n) or (m,n,3) there; earlier and later frames that reach the same points count in."""
        spots = contact_m[rows[0]][in_contact(contact_m, force_n)[rows].any(axis=0)]
        position = self.sheet.quadrature_m.reshape(-1, 2)
        reach = self.pressure.radius_m(TAIL)
        points = np.flatnonzero(within(position, spots, reach))
        if not len(points):
            return points, np.zeros((len(rows), 0, 3) if self._tensor else (len(rows), 0))
        frames = self._remembered(contact_m, force_n, rows, spots, reach)
        pressure = self.pressure_pa(position[points], contact_m[frames], force_n[frames])
        fabric = self.fabric_ohm_sq(pressure, position[points], time_s[frames], np.searchsorted(frames, rows))
        return points, self.sheet_conductance_s(fabric, position[points])

    def _remembered(
        self, contact_m: Array, force_n: Array, rows: NDArray[np.intp], spots: Array, reach_m: float
    ) -> NDArray[np.intp]:
        """(n,) frames that what the ``spots`` do in the frames ``rows`` may depend on, those among them.

        All that pressed near and all in air; where air clears every memory only those since it last did.
        """
        if self.remembers_air:
            return memory_frames(contact_m, force_n, spots, reach_m)
        return frames_since(in_air(contact_m, force_n), rows)

    @property
    def remembers_air(self) -> bool:
        """Whether places that were pressed are not as before while nothing touches them."""
        return any(getattr(part, "remembers_air", False) for part in in_fabric(self.effects))

    def left_behind(
        self, time_s: Array, position_m: Array, pressure_pa: Array, wanted: NDArray[np.intp] | None = None
    ) -> Array:
        """(n,N) relative change of conductance at points (N,2) at the ``wanted`` times, all T by default, after and
        under pressures (T,N)."""
        fabric = self.fabric_ohm_sq(pressure_pa, position_m, time_s, wanted)
        return np.asarray(self.piezo.zero_ohm_sq / fabric - 1.0)

    def _left_behind(self, time_s: Array, contact_m: Array, force_n: Array, wanted: NDArray[np.intp]) -> Array | None:
        """(n,E) what presses have left of themselves in the sheet's elements, None where nothing remembers them."""
        if not self.remembers_air:
            return None
        middle = self.sheet.quadrature_m.mean(axis=1)
        change = np.zeros((len(wanted), len(middle)))
        for few in np.array_split(np.arange(len(middle)), max(1, len(middle) * len(time_s) // TOGETHER)):
            pressure = self.pressure_pa(middle[few], contact_m, force_n)
            change[:, few] = self.left_behind(time_s, middle[few], pressure, wanted)
        return np.where(np.abs(change) > UNCHANGED, change, 0.0)

    @property
    def _tensor(self) -> bool:
        return self.resting_conductance_s.ndim == 2

    def drift(self, time_s: Array) -> Array:
        """(T,) factor on the whole sheet's resistance."""
        return np.prod([np.ones(len(time_s)), *(e.drift(time_s) for e in _of(self.effects, SheetEffect))], axis=0)

    def warmth(self, position_m: Array, time_s: Array, wanted: NDArray[np.intp]) -> Array | None:
        """(n,N) logarithm of what multiplies the conductance for a while at positions (N,2), pressed or not, at the
        ``wanted`` of the times (T,); None where nothing does."""
        effects = _of(self.effects, SheetEffect)
        found = [e.warmth(position_m, time_s, self.sensor, self.protocol) for e in effects]
        parts = [np.multiply.outer(course[wanted], pattern) for pattern, course in filter(None, found)]
        return np.sum(parts, axis=0) if parts else None

    def warm_through(self, position_m: Array) -> Array | None:
        """(N,) the same once scans have followed one another for long: how a skin in use is."""
        found = [e.warm_through(position_m, self.sensor, self.protocol) for e in _of(self.effects, SheetEffect)]
        parts = [part for part in found if part is not None]
        return np.sum(parts, axis=0) if parts else None

    def _solved(
        self,
        conductance_s: Array,
        contact_ohm: Array,
        share: Array | None,
        drift: float,
        drifted: DriftedSheets | None,
    ) -> Array:
        shaped = conductance_s.reshape(*self.sheet.weight_m2.shape, *conductance_s.shape[1:])
        # A sheet resistance times f with contacts z is f times the original sheet with contacts z/f.
        same = np.array_equal(contact_ohm, self.contact_resistance_ohm)
        if drifted is not None and same and drifted.mostly_untouched(shaped):
            return drift * drifted.pair_resistance_ohm(shaped, float(np.log(drift)))
        contacts = contact_ohm / drift
        if conductance_s.ndim > 1 or not np.array_equal(contacts, self.contact_resistance_ohm):
            return drift * self.sheet.solve(shaped, contacts, share).pair_resistance_ohm
        if np.array_equal(shaped, self._resting.conductivity_s):
            return drift * self._resting.pair_resistance_ohm
        return drift * self.sheet.solve_again(shaped, self._resting).pair_resistance_ohm

    @cached_property
    def _resting(self) -> Solution:
        """The untouched isotropic sheet: a press changes a few percent of it."""
        sheet = self.resting_conductance_s.reshape(self.sheet.weight_m2.shape)
        return self.sheet.solve(sheet, self.contact_resistance_ohm)

    # readings ------------------------------------------------------------------------------------------------------

    def known_force_n(self, history: History) -> Array:
        """(T,C) the load cell's force where the history has it, else what the depth predicts."""
        known = np.isfinite(history.force_n)
        if known[history.touched].all():
            return np.where(history.touched, history.force_n, np.nan)
        return np.where(known, history.force_n, self.force_n(history))

    def readings_v(
        self, history: History, force_n: Array | None = None, wanted: NDArray[np.intp] | None = None
    ) -> Array:
        """(n,K,M) volt: noise-free readings of the ``wanted`` frames (n,), all by default, with every effect."""
        skews = _of(self.effects, MotionEffect)
        if skews and self.protocol.timed:
            voltage = self._skewed_v(history, skews[0], force_n, wanted)
        else:
            voltage = self.protocol.readings(self.pair_resistance_ohm(history, force_n, wanted))
        time_s = history.time_s if wanted is None else history.time_s[wanted]
        for effect in sorted(_of(self.effects, AcquisitionEffect), key=lambda e: e.order):
            voltage = effect.read_v(voltage, self.protocol, time_s)
        return voltage

    def _skewed_v(
        self, history: History, skew: MotionEffect, force_n: Array | None, wanted: NDArray[np.intp] | None
    ) -> Array:
        """Readings of presses that go on moving: solved at a few moments of a scan, interpolated between."""
        moments, weights = moments_of(skew, self.protocol)
        still = self.known_force_n(history) if force_n is None else force_n
        voltage = np.zeros((len(history) if wanted is None else len(wanted), *self.protocol.shape))
        for s, share in enumerate(self.moving_share(history, skew, moments)):
            readings = self.protocol.readings(self.pair_resistance_ohm(history, still * share, wanted))
            voltage += weights[:, s, None] * readings
        return voltage

    def moving_share(self, history: History, skew: MotionEffect, moments: Array) -> Iterator[Array]:
        """The part (T,P) of its force that a moving press has at each of the moments (S,) of a scan."""
        at_rest = self.force_n(history)
        for depth_m in np.moveaxis(skew.depth_m(history, moments), 1, 0):
            moved = self.force_n(history, depth_m)
            yield np.where(at_rest > 0, moved / np.where(at_rest > 0, at_rest, 1.0), 1.0)


def moments_of(skew: MotionEffect, protocol: Protocol) -> tuple[Array, Array]:
    """Moments (S,) within a scan at which presses that move are solved, and each one's weight (K,S) in the readings."""
    offset = np.asarray(protocol.injection_offset_s)
    moments = np.linspace(offset.min(), offset.max(), SKEW_NODES)
    if skew.straight:
        moments = moments[[0, -1]]
    return moments, lagrange_weights(moments, offset)


def lagrange_weights(nodes: Array, where: Array) -> Array:
    """(W,S) weights of the polynomial through values at ``nodes`` (S,), evaluated at ``where`` (W,)."""
    weights = np.ones((len(where), len(nodes)))
    for s, node in enumerate(nodes):
        for other in np.delete(nodes, s):
            weights[:, s] *= (where - other) / (node - other)
    return weights


def _of(effects: Iterable[Effect], kind: type[Kind]) -> list[Kind]:
    return [effect for effect in effects if isinstance(effect, kind)]

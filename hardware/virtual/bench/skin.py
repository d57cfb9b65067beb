"""The bench's skin between force and admittance: pressure, memory of the pair, sheet and contacts."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.virtual.bench.fields import gaussian_field, patch
from ertskin.hardware.virtual.bench.pad import FourierPad, PadResolution
from ertskin.hardware.virtual.bench.piezo import ClosingLaw, LogCreep, WedgeMemory
from ertskin.hardware.virtual.bench.sheet import SpectralSheet
from ertskin.hardware.virtual.bench.truth import Truth
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

STIFFENED = (1.0, 1.3, 1.7, 2.3, 3.2)
"""Multiples of the foam's modulus at which the pressure's spread is worked out; between them it is interpolated."""


@dataclass(frozen=True)
class Resolution:
    """Degree and largest size of the sheet's elements, and how the pad is cut."""

    degree: int = 8
    largest_m: float = 0.0046
    pad: PadResolution = field(default_factory=PadResolution)
    unchanged: float = 2e-5


FINE = Resolution()
FINEST = Resolution(12, 0.0031, PadResolution(12, 0.16, 400, 800), 0.0)
FAST = Resolution(6, 0.0061, PadResolution(6, 0.1, 160, 200), 1e-4)
"""``unchanged``: elements whose conductivity differs relatively less than this from the unloaded one keep it."""


class BenchSkin:
    """One skin with what it remembers: press it in time order, ask for its transfer matrix whenever.

    Only rectangular sheets with rectangular pads inside them; anything else raises ``ValueError``.
    """

    def __init__(self, sensor: Sensor, truth: Truth, resolution: Resolution = FINE) -> None:
        corners = {tuple(corner) for corner in sensor.outline_m.round(9).tolist()}
        size = tuple(sensor.extent_m[1].round(9).tolist())
        if corners != {(0.0, 0.0), (size[0], 0.0), (0.0, size[1]), size} or sensor.electrode_edge_m is not None:
            raise ValueError("the bench needs a rectangular sheet from the origin with pads inside it")
        self.sensor, self.truth, self.resolution = sensor, truth, resolution
        centers = np.array(sensor.electrode_center_m)
        displaced = truth.parameters("electrode_displacement")
        if displaced:
            centers[displaced["electrode"]] += displaced["shift_m"]
        self.sheet = SpectralSheet(size, centers, sensor.electrode_size_m, resolution.degree, resolution.largest_m)
        self.law = ClosingLaw(**truth.law)
        self._draw_maps()
        self._pads = [self._pad(multiple) for multiple in (STIFFENED if truth.parameters("nonlinear_foam") else (1.0,))]
        self.stiffness_n_per_m = self._pads[0].stiffness_n_per_m
        self._units: dict[bytes, list[Array]] = {}
        hysteresis, creep = truth.parameters("piezo_hysteresis"), truth.parameters("piezo_creep")
        self._wedge = WedgeMemory(**hysteresis) if hysteresis else None
        self._creep = LogCreep(**creep) if creep else None
        shape = self.sheet.points_m.shape[:2]
        self._lagging = self._wedge.start(shape) if self._wedge else None
        self._crept = self._creep.start(shape) if self._creep else None
        self._effective = np.zeros(shape)
        self._lately: deque[tuple[float, Array, Array, Array]] = deque(maxlen=16)
        self._contact = np.array(truth.contact_ohm)
        self._unloaded = self._sheet_conductivity(np.zeros(shape))
        self._reference = self.sheet.factor(self._tensor(np.arange(self.sheet.elements), self._unloaded), self._contact)

    def _pad(self, multiple: float) -> FourierPad:
        foam = self.sensor.layers[0].name
        modulus = {**self.truth.modulus_pa, foam: self.truth.modulus_pa[foam] * multiple}
        sensor = self.sensor.with_layers(**modulus)
        points, diameter = sensor.indenter_points_m, sensor.indenter_diameter_m
        return FourierPad(sensor.layers, sensor.piezo_interface, points, diameter, self.resolution.pad)

    def _draw_maps(self) -> None:
        points = self.sheet.points_m
        self._sensitivity = np.ones(points.shape[:2])
        self._gap_pa = np.zeros(points.shape[:2])
        self._sheet_map = np.ones(points.shape[:2])
        uneven = self.truth.parameters("piezo_inhomogeneity")
        if uneven:
            field = gaussian_field(points, uneven["field"], uneven["length_m"])
            self._sensitivity = np.exp(uneven["amplitude"] * field)
        torn = self.truth.parameters("torn_patch")
        if torn:
            where = patch(points, np.array(torn["center_m"]), torn["radius_m"], 6e-4)
            self._sensitivity = self._sensitivity * (1.0 - torn["lost_share"] * where)
        loose = self.truth.parameters("delaminated_spot")
        if loose:
            self._gap_pa = loose["gap_pa"] * patch(points, np.array(loose["center_m"]), loose["radius_m"], 1.2e-3)
        streaky = self.truth.parameters("sheet_inhomogeneity")
        if streaky:
            self._sheet_map = np.exp(
                streaky["amplitude"] * gaussian_field(points, streaky["field"], streaky["length_m"])
            )
        grain = self.truth.parameters("sheet_anisotropy")
        self._grain: Array | None = None
        if grain:
            stretch, angle = np.exp(grain["log_ratio"] / 2), grain["angle_rad"]
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            tensor = turn @ np.diag([stretch, 1 / stretch]) @ turn.T
            self._grain = np.array([tensor[0, 0], tensor[1, 1], tensor[0, 1]])

    def landing_m(self, contact_m: Array) -> Array:
        """(...,2) where the indenter really lands for a commanded position (stage frame against sensor frame)."""
        offset = self.truth.parameters("indenter_offset")
        if not offset:
            return contact_m
        arm = contact_m - self.sensor.extent_m.mean(axis=0)
        turned = offset["turn_rad"] * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        return contact_m + np.array(offset["shift_m"]) + turned

    def pressure_pa(self, landing_m: Array, force_n: Array, stiffened: float = 1.0) -> Array:
        """(E,Q) interface pressure under contacts (P,2) with forces (P,), the foam ``stiffened`` that many times."""
        total = np.zeros(self.sheet.points_m.shape[:2])
        for place, force in zip(landing_m, force_n, strict=True):
            if not np.isfinite(place).all() or force <= 0.0:
                continue
            units = self._unit(place)
            if len(units) == 1:
                total += force * units[0]
                continue
            position = np.interp(np.log(stiffened), np.log(STIFFENED), np.arange(len(STIFFENED)))
            low = min(int(position), len(units) - 2)
            total += force * ((low + 1 - position) * units[low] + (position - low) * units[low + 1])
        return total

    def _unit(self, place: Array) -> list[Array]:
        key = place.tobytes()
        if key not in self._units:
            if len(self._units) >= 8:
                self._units.pop(next(iter(self._units)))
            self._units[key] = [pad.pressure_pa(self.sheet.points_m - place) for pad in self._pads]
        return self._units[key]

    def dwell(self, pressure_pa: Array, seconds: float) -> None:
        """Let the pair sit under a pressure for a time: what it remembers moves on."""
        felt = np.maximum(pressure_pa - self._gap_pa, 0.0) * self._sensitivity
        if self._wedge is not None and self._lagging is not None:
            self._lagging, felt = self._wedge.follow(self._lagging, felt)
        if self._creep is not None and self._crept is not None and seconds > 0.0:
            self._crept = self._creep.dwell(self._crept, felt, seconds)
        self._effective = felt

    def _sheet_conductivity(self, effective_pa: Array) -> Array:
        resistance = self.law.resistance_ohm(effective_pa) * self._sheet_map
        if self._creep is not None and self._crept is not None:
            resistance = resistance * self._creep.factor(self._crept)
        return 1.0 / resistance

    def _tensor(self, element: NDArray[np.intp], conductivity_s: Array) -> Array:
        part = conductivity_s[element]
        return part if self._grain is None else part[..., None] * self._grain

    def transfer_ohm(self, pressure_pa: Array, time_s: float, contact_ohm: Array | None = None) -> Array:
        """(L,L) transfer matrix now, under a pressure at a time; call ``dwell`` first, this remembers nothing.

        ``contact_ohm`` (L,) unpressed contact resistances, the truth's without it.
        """
        conductivity = self._sheet_conductivity(self._effective)
        changed = (np.abs(conductivity / self._unloaded - 1.0) > self.resolution.unchanged).any(axis=1)
        warmth = self._warmth(time_s)
        unpressed = self._contact if contact_ohm is None else contact_ohm
        contact = unpressed * self._contact_factor(pressure_pa) / warmth
        moved = np.abs(contact / self._reference.contact_ohm - 1.0) > 1e-9
        changed |= (self.sheet.pad >= 0) & moved[self.sheet.pad]
        if not changed.any():
            return self._filmed(warmth * self._reference.transfer_ohm)
        contact = np.where(moved, contact, self._reference.contact_ohm)
        return self._filmed(warmth * self._eliminated(np.flatnonzero(changed), conductivity, contact))

    def _eliminated(self, element: NDArray[np.intp], conductivity_s: Array, contact_ohm: Array) -> Array:
        """The sheet's own transfer matrix; one that was worked out lately, on the way down, is not worked out again."""
        total = float(conductivity_s.sum())
        for known_total, known_s, known_ohm, transfer in self._lately:
            close = abs(total - known_total) < 1e-9 * total and np.allclose(
                contact_ohm, known_ohm, rtol=1e-10, atol=0.0
            )
            if close and np.allclose(conductivity_s, known_s, rtol=1e-8, atol=0.0):
                return transfer
        factor = self._reference.changed(element, self._tensor(element, conductivity_s), contact_ohm)
        transfer = factor.transfer_ohm
        self._lately.append((total, conductivity_s, contact_ohm, transfer))
        return transfer

    def _warmth(self, time_s: float) -> float:
        drift = self.truth.parameters("temperature_drift")
        return 1.0 if not drift else 1.0 + drift["final_share"] * (1.0 - np.exp(-time_s / drift["settle_s"]))

    def _contact_factor(self, pressure_pa: Array) -> Array:
        """(L,) Holm: more pressure, more spots in contact."""
        dependence = self.truth.parameters("contact_pressure_dependence")
        if not dependence:
            return np.ones(self.sheet.electrodes)
        under = self.sheet.pad >= 0
        load = (pressure_pa * self.sheet.weight_m2)[under].sum(axis=1)
        mean = np.bincount(self.sheet.pad[under], load, self.sheet.electrodes) / self.sheet.pad_area_m2
        return (1.0 + np.maximum(mean, 0.0) / dependence["pressure_pa"]) ** -dependence["exponent"]

    def _filmed(self, transfer_ohm: Array) -> Array:
        """A damp film that bridges each electrode to the next."""
        film = self.truth.parameters("humidity_film")
        if not film:
            return transfer_ohm
        admittance = np.linalg.pinv(transfer_ohm, rcond=1e-12, hermitian=True)
        count = len(admittance)
        for electrode, bridge in enumerate(film["conductance_s"]):
            step = np.zeros(count)
            step[electrode], step[(electrode + 1) % count] = 1.0, -1.0
            admittance += bridge * np.outer(step, step)
        return np.linalg.pinv(admittance, rcond=1e-12, hermitian=True)

"""Values no skin bench gives in SI units: the mark of a file written in millimetres, millivolts or milliseconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.measurement import Coupon, Frames, Recording, RigidBlock, Specimen
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class Doubt:
    """A field whose values look like another unit's."""

    field: str
    found: str
    expected: str

    def __str__(self) -> str:
        return f"{self.field}: found {self.found}, expected {self.expected}"


@dataclass(frozen=True)
class Range:
    """Where the largest absolute value of a field lies on any bench; zero stands for a field not in use."""

    low: float
    high: float
    unit: str
    hint: str

    def doubt(self, field: str, values: NDArray[np.generic] | float) -> Doubt | None:
        """What speaks against the field's unit, or None."""
        size = np.abs(values)
        largest = float(np.max(size, initial=0.0, where=np.isfinite(size)))
        if largest == 0.0 or self.low <= largest <= self.high:
            return None
        expected = f"{self.low:g} to {self.high:g} {self.unit} at most"
        return Doubt(field, f"largest value {largest:g}, {self.hint}", expected)


_LENGTH = Range(1e-3, 10.0, "m", "looks like another unit than metres")
_THIN = Range(1e-6, 0.2, "m", "looks like another unit than metres")
_DEPTH = Range(1e-6, 0.1, "m", "looks like another unit than metres")
_FORCE = Range(1e-4, 500.0, "N", "looks like another unit than newton")
_SERIES_S = Range(0.0, 1e7, "s", "looks like another unit than seconds")
_VOLT = Range(1e-9, 1e3, "V", "looks like another unit than volt")
_CURRENT = Range(1e-9, 2.0, "A", "looks like another unit than ampere")
_MODULUS = Range(1e2, 1e12, "Pa", "looks like another unit than pascal")
_STRESS = Range(1e2, 1e9, "Pa", "looks like another unit than pascal")
_RESISTANCE = Range(1e-4, 1e10, "ohm", "looks like another unit than ohm")
_AREA = Range(1e-8, 1.0, "m2", "looks like another unit than square metres")

_READING_PER_SHEET = Range(2e-3, 500.0, "sheet resistances", "so volt, ampere or ohm looks like another unit")


def sensor_doubts(sensor: Sensor, found: frozenset[str]) -> list[Doubt]:
    """Doubts about a sensor; only fields in ``found`` (those the file holds) are judged."""
    layers = sensor.layers
    doubts = [
        _LENGTH.doubt("/sensor/outline_m or size_m", np.ptp(sensor.outline_m, axis=0)),
        _LENGTH.doubt("/sensor/electrode_center_m", np.ptp(sensor.electrode_center_m, axis=0, keepdims=True))
        if len(sensor.electrode_center_m) > 1
        else None,
        _THIN.doubt("/sensor/electrode_size_m", sensor.electrode_size_m),
        _LENGTH.doubt("/sensor/taxel_m", sensor.taxel_m),
        _THIN.doubt("/sensor/indenter_points_m", sensor.indenter_points_m),
        _THIN.doubt("/sensor/layers thickness_m", np.array([layer.thickness_m for layer in layers])),
        _MODULUS.doubt("/sensor/layers youngs_modulus_pa", np.array([layer.youngs_modulus_pa for layer in layers])),
    ]
    if "sheet_resistance_ohm_sq" in found:
        doubts.append(_RESISTANCE.doubt("/sensor/sheet_resistance_ohm_sq", sensor.sheet_resistance_ohm_sq))
    if "indenter_diameter_m" in found:
        doubts.append(_THIN.doubt("/sensor/indenter_diameter_m", sensor.indenter_diameter_m))
    return [doubt for doubt in doubts if doubt]


def frame_doubts(frames: Frames, sensor: Sensor | None, protocol: Protocol | None, sheet_known: bool) -> list[Doubt]:
    """Doubts about the frames. Voltages are judged only where a protocol says that they are volts."""
    history = frames.history
    contact = history.contact_m
    doubts = [
        _LENGTH.doubt("/frames/contact_m", contact),
        _DEPTH.doubt("/frames/depth_m", history.depth_m),
        _FORCE.doubt("/frames/force_n", history.force_n),
    ]
    if len(history.time_s):
        doubts.append(_SERIES_S.doubt("/frames/time_s", np.ptp(history.time_s)))
    if sensor is not None and contact.size and np.isfinite(contact).any():
        doubts.append(_far_from_sheet(contact, sensor))
    if protocol is not None:
        doubts.append(_VOLT.doubt("/frames/voltage_v", frames.voltage_v))
        doubts.append(_beyond_limit(frames, protocol))
        if sensor is not None and sheet_known:
            doubts.append(_against_sheet(frames, sensor, protocol))
    return [doubt for doubt in doubts if doubt]


def _far_from_sheet(contact_m: NDArray[np.float64], sensor: Sensor) -> Doubt | None:
    low, high = sensor.extent_m
    reach = 10.0 * float(np.max(high - low)) + sensor.pad_margin_m
    points = contact_m[np.isfinite(contact_m).all(axis=-1)]
    farthest = float(np.max(np.maximum(low - points, points - high), initial=0.0))
    if farthest <= reach:
        return None
    found = f"a contact {farthest:g} m off the sheet, looks like another unit than metres"
    return Doubt("/frames/contact_m", found, f"contacts within {reach:g} m of the sheet")


def _beyond_limit(frames: Frames, protocol: Protocol) -> Doubt | None:
    limit = protocol.adc_limit_v
    if limit is None or not frames.voltage_v.size:
        return None
    largest = float(np.nanmax(np.abs(frames.voltage_v)))
    if largest <= 1.5 * limit:
        return None
    return Doubt("/frames/voltage_v", f"{largest:g} V, looks like another unit than volt", f"adc_limit_v {limit:g} V")


def _against_sheet(frames: Frames, sensor: Sensor, protocol: Protocol) -> Doubt | None:
    """A sheet's readings are near its sheet resistance times the current, whatever its outline."""
    current = float(np.max(np.abs(protocol.injection_current_a)))
    if not frames.voltage_v.size or current == 0.0 or sensor.sheet_resistance_ohm_sq <= 0.0:
        return None
    reading = np.abs(frames.voltage_v[0][protocol.taken])
    if np.isnan(reading).all():
        return None
    typical = float(np.nanmedian(reading)) / current / sensor.sheet_resistance_ohm_sq
    return _READING_PER_SHEET.doubt("/frames/voltage_v over current_a and sheet_resistance_ohm_sq", typical)


def protocol_doubts(protocol: Protocol) -> list[Doubt]:
    """Doubts about a protocol."""
    doubts = [_CURRENT.doubt("/protocol/current_a", protocol.injection_current_a)]
    for field, value, span in (
        ("scan_s", protocol.scan_s, Range(1e-6, 1e4, "s", "looks like another unit than seconds")),
        ("adc_limit_v", protocol.adc_limit_v, _VOLT),
        ("adc_volts_per_count", protocol.adc_volts_per_count, Range(1e-12, 1.0, "V", "looks like another unit")),
        ("injection_offset_s", protocol.injection_offset_s, Range(0.0, 1e4, "s", "looks like another unit")),
    ):
        if value is not None:
            doubts.append(span.doubt(f"/protocol/{field}", value))
    return [doubt for doubt in doubts if doubt]


def specimen_doubts(specimen: Specimen) -> list[Doubt]:
    """Doubts about a specimen test."""
    doubts = [
        _STRESS.doubt("/specimen/stress_pa", specimen.stress_pa),
        _RESISTANCE.doubt("/specimen/sheet_resistance_ohm_sq", specimen.sheet_resistance_ohm_sq),
    ]
    if len(specimen.time_s):
        doubts.append(_SERIES_S.doubt("/specimen/time_s", np.ptp(specimen.time_s)))
    return [doubt for doubt in doubts if doubt]


def rigid_block_doubts(block: RigidBlock) -> list[Doubt]:
    """Doubts about a rigid-block run."""
    doubts = [_DEPTH.doubt("/rigid_block/depth_m", block.depth_m), _FORCE.doubt("/rigid_block/force_n", block.force_n)]
    return [doubt for doubt in doubts if doubt]


def coupon_doubts(coupon: Coupon) -> list[Doubt]:
    """Doubts about a coupon test."""
    doubts = [
        _THIN.doubt("/coupon/gap_m", coupon.gap_m),
        _THIN.doubt("/coupon/height_m", coupon.height_m),
        _AREA.doubt("/coupon/area_m2", coupon.area_m2),
        Range(1e-4, 1e5, "N", "looks like another unit than newton").doubt("/coupon/force_n", coupon.force_n),
    ]
    if len(coupon.time_s):
        doubts.append(_SERIES_S.doubt("/coupon/time_s", np.ptp(coupon.time_s)))
    largest = float(np.max(coupon.gap_m, initial=0.0))
    if largest > 0 and not 0.05 < largest / coupon.height_m < 20.0:
        doubts.append(
            Doubt("/coupon/gap_m", f"largest gap {largest:g} m", f"a gap near height_m {coupon.height_m:g} m")
        )
    return [doubt for doubt in doubts if doubt]


def doubts(recording: Recording, sensor_fields: frozenset[str]) -> list[Doubt]:
    """Everything in a recording that looks like another unit's; ``sensor_fields`` are those its file holds."""
    found: list[Doubt] = []
    if recording.sensor is not None:
        found += sensor_doubts(recording.sensor, sensor_fields)
    if recording.protocol is not None:
        found += protocol_doubts(recording.protocol)
    if recording.frames is not None:
        sheet_known = "sheet_resistance_ohm_sq" in sensor_fields
        found += frame_doubts(recording.frames, recording.sensor, recording.protocol, sheet_known)
    if recording.specimen is not None:
        found += specimen_doubts(recording.specimen)
    if recording.rigid_block is not None:
        found += rigid_block_doubts(recording.rigid_block)
    if recording.coupon is not None:
        found += coupon_doubts(recording.coupon)
    return found

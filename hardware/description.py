"""A sensor and a scan described in plain types, as a YAML file gives them. SI units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.protocol import Protocol, electrode_pairs
from ertskin.physics.sensor import (
    Layer,
    Sensor,
    disk_m,
    edge_electrodes_m,
    four_points_m,
    rectangle_m,
    taxel_grid_m,
)


class DescriptionError(ValueError):
    """A description that makes no sensor or no scan: one line saying which field and why."""


def sensor_of(fields: Mapping[str, Any]) -> Sensor:
    """A sensor from the fields of the recording format's ``/sensor``.

    ``size_m``, ``radius_m`` (a disk that fills [0,2R]x[0,2R]) or ``outline_m``; ``electrode_center_m`` with
    ``electrode_size_m`` (one for all or each), ``electrode_edge_m``, or ``edge_electrodes``: the arguments of
    ``edge_electrodes_m`` after the outline; ``taxel_m`` or ``taxel_grid`` (columns, rows); ``layers`` top down. Raises
    ``DescriptionError``.
    """
    try:
        outline = _outline_m(fields)
        values: dict[str, Any] = {"outline_m": outline}
        if "edge_electrodes" in fields:
            values["electrode_edge_m"] = edge_electrodes_m(outline, **fields["edge_electrodes"])
        elif "electrode_edge_m" in fields:
            values["electrode_edge_m"] = np.array(fields["electrode_edge_m"], dtype=float).reshape(-1, 2, 2)
        else:
            center = np.array(fields["electrode_center_m"], dtype=float).reshape(-1, 2)
            size = np.array(fields["electrode_size_m"], dtype=float)
            values |= {"electrode_center_m": center, "electrode_size_m": np.broadcast_to(size, center.shape).copy()}
        if "taxel_grid" in fields:
            columns, rows = fields["taxel_grid"]
            values["taxel_m"] = taxel_grid_m(np.ptp(outline, axis=0), columns, rows)
        elif "taxel_m" in fields:
            values["taxel_m"] = np.array(fields["taxel_m"], dtype=float).reshape(-1, 2)
        values["layers"] = tuple(
            Layer(str(x["name"]), float(x["thickness_m"]), float(x["youngs_modulus_pa"]), float(x["poissons_ratio"]))
            for x in fields.get("layers") or ()
        )
        for name in ("sheet_resistance_ohm_sq", "contact_resistance_guess_ohm", "indenter_diameter_m", "pad_margin_m"):
            if name in fields:
                values[name] = float(fields[name])
        values["piezo_interface"] = int(fields.get("piezo_interface", 0))
        values["indenter_points_m"] = four_points_m(values.get("indenter_diameter_m", Sensor.indenter_diameter_m))
        return Sensor(**values)
    except (KeyError, TypeError, ValueError) as error:
        raise DescriptionError(f"sensor: {type(error).__name__}: {error}") from None


def _outline_m(fields: Mapping[str, Any]) -> NDArray[np.float64]:
    if "size_m" in fields:
        return rectangle_m(fields["size_m"])
    if "radius_m" in fields:
        return disk_m(float(fields["radius_m"]))
    return np.array(fields["outline_m"], dtype=float)


def protocol_of(fields: Mapping[str, Any], electrodes: int) -> Protocol:
    """A scan from the fields of the recording format's ``/protocol``.

    ``injection``: ``all`` pairs, ``adjacent`` ones, or a list; ``measurement``: ``sink`` (every electrode against the
    sink), ``adjacent`` differences, or a list of pairs; ``measured``: ``all`` of these, or ``undriven`` where readings
    at a driven electrode are not taken; injections are spread evenly over ``scan_s``. Raises ``DescriptionError``.
    """
    try:
        pairs = _pairs(fields.get("injection", "all"), electrodes)
        current = float(fields["current_a"])
        extra: dict[str, Any] = {
            name: float(fields[name])
            for name in ("scan_s", "adc_volts_per_count", "adc_limit_v")
            if fields.get(name) is not None
        }
        if "scan_s" in extra:
            extra["injection_offset_s"] = extra["scan_s"] * np.arange(len(pairs)) / len(pairs)
        measurement = fields.get("measurement", "sink")
        columns = None if measurement == "sink" else _pairs(measurement, electrodes)
        extra["measured"] = _measured(fields.get("measured", "all"), pairs, columns)
        if columns is None:
            return Protocol.against_sink(pairs, electrodes, current, **extra)
        identity = np.eye(electrodes)
        injected = current * (identity[pairs[:, 0]] - identity[pairs[:, 1]])
        weights = np.broadcast_to(
            identity[columns[:, 0]] - identity[columns[:, 1]], (len(pairs), len(columns), electrodes)
        )
        return Protocol(injected, weights.copy(), pairs, **extra)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise DescriptionError(f"protocol: {type(error).__name__}: {error}") from None


def _measured(choice: Any, pairs: NDArray[np.intp], columns: NDArray[np.intp] | None) -> NDArray[np.bool_] | None:
    """(K,M) readings taken: all, or those at no driven electrode."""
    if choice == "all":
        return None
    if choice != "undriven" or columns is None:
        raise ValueError(f"measured: {choice!r} with these readings; all, or undriven with differences of electrodes")
    return np.asarray(~(columns[None, :, :, None] == pairs[:, None, None, :]).any(axis=(2, 3)))


def _pairs(choice: Any, electrodes: int) -> NDArray[np.intp]:
    if choice == "all":
        return electrode_pairs(electrodes)
    if choice == "adjacent":
        first = np.arange(electrodes)
        return np.stack([first, (first + 1) % electrodes], axis=1)
    pairs = np.array(choice, dtype=np.intp).reshape(-1, 2)
    if len(pairs) == 0 or pairs.min() < 0 or pairs.max() >= electrodes or (pairs[:, 0] == pairs[:, 1]).any():
        raise ValueError(f"pairs must be of different electrodes from 0 to {electrodes - 1}")
    return pairs

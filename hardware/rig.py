"""A bench: its instruments, where the skin lies in the stage's frame, and what must never be exceeded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hardware.clock import Clock, SystemClock
from hardware.ert_readers.eit_kit import eit_kit
from hardware.ert_readers.link import ErtLink
from hardware.ert_readers.spectra import spectra
from hardware.instrument import ErtReader, LoadCell, Stage, Travel
from hardware.load_cells.futek import futek
from hardware.load_cells.hx711 import hx711
from hardware.load_cells.mark10 import Mark10
from hardware.stages.grbl import Grbl
from hardware.stages.marlin import Marlin
from hardware.transport import SerialTransport, Transport
from physics.protocol import Protocol
from physics.sensor import Sensor


@dataclass(frozen=True)
class Limits:
    """What stops a recording. Forces in newton, lengths in metres, speeds in metres a second."""

    force_n: float = 15.0
    depth_m: float = 4.5e-3
    zero_force_n: float = 0.3
    touch_force_n: float = 0.1
    touch_range_m: float = 0.01
    approach_m: float = 1e-3
    clearance_m: float = 0.01
    travel_speed_m_s: float = 0.02
    touch_speed_m_s: float = 5e-4


@dataclass(frozen=True)
class Geometry:
    """Where things are in the stage's frame.

    ``origin_m``: the sheet's corner (0, 0), and about the height of the surface, too high rather than too low.
    ``block_m``: the middle of a rigid block's surface, if there is one; ``specimen_m`` that of a specimen's plate.
    """

    origin_m: tuple[float, float, float]
    block_m: tuple[float, float, float] | None = None
    specimen_m: tuple[float, float, float] | None = None


@dataclass
class Rig:
    """An opened bench."""

    name: str
    clock: Clock
    stage: Stage
    load_cell: LoadCell
    reader: ErtReader
    sensor: Sensor
    protocol: Protocol
    geometry: Geometry
    limits: Limits = field(default_factory=Limits)

    def close(self) -> None:
        """Let go of every port."""
        for instrument in (self.stage, self.load_cell, self.reader):
            instrument.close()


BAUD = {
    "grbl": 115_200,
    "marlin": 250_000,
    "hx711": 115_200,
    "mark10": 115_200,
    "futek": 115_200,
    "link": 921_600,
    "spectra": 115_200,
    "eit_kit": 115_200,
}
"""Baud rates the devices come with, by the driver's name."""


def _travel(fields: Mapping[str, Any]) -> Travel:
    low, high = fields["travel_low_m"], fields["travel_high_m"]
    return Travel((low[0], low[1], low[2]), (high[0], high[1], high[2]))


STAGES: Mapping[str, Callable[[Transport, Mapping[str, Any]], Stage]] = {
    "grbl": lambda line, fields: Grbl(line, _travel(fields)),
    "marlin": lambda line, fields: Marlin(line, _travel(fields), fields.get("home_command", "G28")),
}
LOAD_CELLS: Mapping[str, Callable[[Transport, Mapping[str, Any]], LoadCell]] = {
    "hx711": lambda line, fields: hx711(
        line,
        fields.get("layout", "counts"),
        fields.get("unit", "N"),
        fields.get("newton_per_count", 1.0),
        fields.get("zero_count", 0.0),
    ),
    "mark10": lambda line, _fields: Mark10(line),
    "futek": lambda line, fields: futek(line, fields.get("compression", 1.0)),
}
READERS: Mapping[str, Callable[[Transport, Mapping[str, Any], tuple[int, int]], ErtReader]] = {
    "link": lambda line, _fields, shape: ErtLink(line, shape),
    "spectra": lambda line, fields, shape: spectra(line, shape, fields.get("volts_per_unit", 1.0)),
    "eit_kit": lambda line, fields, shape: eit_kit(line, shape[0], fields.get("volts_per_unit", 1.0)),
}


class RigError(ValueError):
    """A rig's description that can't be used: one line saying what is wrong."""


def open_rig(fields: Mapping[str, Any], sensor: Sensor, protocol: Protocol, clock: Clock | None = None) -> Rig:
    """Open a bench's ports. ``fields`` as in ``conf/rig``: ``name``, ``stage``, ``load_cell`` and ``ert_reader`` (each
    with ``driver``, ``port``, perhaps ``baud`` and what the driver takes), ``geometry``, ``limits``.

    Raises ``RigError`` for a description that makes no sense, ``LostContact`` where a port can't be opened.
    """
    clock = clock or SystemClock()
    opened: list[Transport] = []
    try:
        stage = STAGES[_driver(fields, "stage", STAGES)](_line(fields, "stage", clock, opened), fields["stage"])
        cell = LOAD_CELLS[_driver(fields, "load_cell", LOAD_CELLS)](
            _line(fields, "load_cell", clock, opened), fields["load_cell"]
        )
        reader = READERS[_driver(fields, "ert_reader", READERS)](
            _line(fields, "ert_reader", clock, opened), fields["ert_reader"], protocol.shape
        )
        geometry = Geometry(**{name: value and tuple(value) for name, value in fields["geometry"].items()})
        limits = Limits(**fields.get("limits", {}))
    except (KeyError, TypeError, IndexError) as error:
        _close(opened)
        raise RigError(f"rig {fields.get('name', '')}: {type(error).__name__} {error}") from None
    except BaseException:
        _close(opened)
        raise
    return Rig(str(fields.get("name", "")), clock, stage, cell, reader, sensor, protocol, geometry, limits)


def _driver(fields: Mapping[str, Any], part: str, known: Mapping[str, object]) -> str:
    name = fields[part]["driver"]
    if name not in known:
        raise RigError(f"{part}: no driver {name!r}; choose one of {', '.join(known)}")
    return str(name)


def _line(fields: Mapping[str, Any], part: str, clock: Clock, opened: list[Transport]) -> Transport:
    entry = fields[part]
    line = SerialTransport(str(entry["port"]), int(entry.get("baud") or BAUD[entry["driver"]]), clock)
    opened.append(line)
    return line


def _close(opened: list[Transport]) -> None:
    for line in opened:
        line.close()

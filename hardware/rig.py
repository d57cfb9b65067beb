"""A bench: its instruments, where the skin lies in the stage's frame, and what must never be exceeded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ertskin.hardware.clock import Clock, SystemClock
from ertskin.hardware.ert_readers.eit_kit import eit_kit
from ertskin.hardware.ert_readers.link import ErtLink
from ertskin.hardware.ert_readers.spectra import spectra
from ertskin.hardware.instrument import ErtReader, LoadCell, Stage, Travel
from ertskin.hardware.load_cells.futek import futek
from ertskin.hardware.load_cells.hx711 import hx711
from ertskin.hardware.load_cells.mark10 import Mark10
from ertskin.hardware.stages.grbl import Grbl
from ertskin.hardware.stages.marlin import Marlin
from ertskin.hardware.transport import SerialTransport, Transport
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

T = TypeVar("T")
LEAST_HANG_S = 5.0
"""A recording gives a sign of life every second; on a busy machine one may come late."""


@dataclass(frozen=True)
class Limits:
    """What stops a recording. Forces in newton, lengths in metres, speeds in metres a second.

    ``hang_s``: seconds without a sign of life, the indenter down, after which the recording counts as hung.
    """

    force_n: float = 15.0
    depth_m: float = 4.5e-3
    zero_force_n: float = 0.3
    touch_force_n: float = 0.1
    touch_range_m: float = 0.01
    approach_m: float = 1e-3
    clearance_m: float = 0.01
    travel_speed_m_s: float = 0.02
    touch_speed_m_s: float = 5e-4
    hang_s: float = 60.0

    def __post_init__(self) -> None:
        if not self.hang_s >= LEAST_HANG_S:
            raise RigError(f"limits.hang_s: found {self.hang_s:g} s, expected at least {LEAST_HANG_S:g} s")


@dataclass(frozen=True)
class Geometry:
    """Where things are in the stage's frame.

    ``origin_m``: the sheet's corner (0, 0), and about the height of the surface, too high rather than too low.
    ``block_m``: the middle of a rigid block's surface, if there is one; ``specimen_m`` that of a specimen's plate.
    """

    origin_m: tuple[float, float, float]
    block_m: tuple[float, float, float] | None = None
    specimen_m: tuple[float, float, float] | None = None


def _nobody(_lowered: bool) -> None: ...


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
    tell_lowered: Callable[[bool], None] = _nobody
    """Told True before the indenter goes below the height for travelling, and False when it is back there."""

    def close(self) -> None:
        """Let go of every port."""
        for instrument in (self.stage, self.load_cell, self.reader):
            instrument.close()


class RigError(ValueError):
    """A rig's description that can't be used: one line saying what is wrong."""


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


def _eit_kit(line: Transport, fields: Mapping[str, Any], shape: tuple[int, int]) -> ErtReader:
    electrodes, readings = shape
    if electrodes != readings:
        raise RigError(f"an EIT-kit reads N x N values, the sensor's protocol has {electrodes} x {readings}")
    return eit_kit(line, electrodes, fields.get("volts_per_unit", 1.0))


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
    "eit_kit": _eit_kit,
}


def open_rig(fields: Mapping[str, Any], sensor: Sensor, protocol: Protocol, clock: Clock | None = None) -> Rig:
    """Open a bench's ports. ``fields`` as in ``conf/rig``: ``name``, ``stage``, ``load_cell`` and ``ert_reader`` (each
    with ``driver``, ``port``, perhaps ``baud`` and what the driver takes), ``geometry``, ``limits``.

    Raises ``RigError`` for a description that makes no sense, ``LostContact`` where a port can't be opened.
    """
    clock = clock or SystemClock()
    with ExitStack() as opened:
        stage = open_stage(fields, clock)
        opened.callback(stage.close)
        cell = open_load_cell(fields, clock)
        opened.callback(cell.close)
        reader = open_reader(fields, clock, protocol.shape)
        opened.callback(reader.close)
        try:
            geometry = Geometry(**{name: value and tuple(value) for name, value in fields["geometry"].items()})
            limits = Limits(**fields.get("limits", {}))
        except (KeyError, TypeError) as error:
            raise RigError(f"rig {fields.get('name', '')}: {type(error).__name__} {error}") from None
        opened.pop_all()
    return Rig(str(fields.get("name", "")), clock, stage, cell, reader, sensor, protocol, geometry, limits)


def open_stage(fields: Mapping[str, Any], clock: Clock) -> Stage:
    """A rig's stage alone; raises as ``open_rig``."""
    return _opened(fields, "stage", STAGES, clock)


def open_load_cell(fields: Mapping[str, Any], clock: Clock) -> LoadCell:
    """A rig's load cell alone; raises as ``open_rig``."""
    return _opened(fields, "load_cell", LOAD_CELLS, clock)


def open_reader(fields: Mapping[str, Any], clock: Clock, shape: tuple[int, int]) -> ErtReader:
    """A rig's ERT reader alone, for scans of ``shape`` (K,M); raises as ``open_rig``."""
    return _opened(fields, "ert_reader", READERS, clock, shape)


def _opened(
    fields: Mapping[str, Any], part: str, drivers: Mapping[str, Callable[..., T]], clock: Clock, *more: object
) -> T:
    with ExitStack() as opened:
        try:
            entry = fields[part]
            if entry["driver"] not in drivers:
                raise RigError(f"no driver {entry['driver']!r}; choose one of {', '.join(drivers)}")
            line = SerialTransport(str(entry["port"]), int(entry.get("baud") or BAUD[entry["driver"]]), clock)
            opened.callback(line.close)
            driver = drivers[entry["driver"]](line, entry, *more)
        except (KeyError, TypeError, IndexError) as error:
            raise RigError(f"rig {fields.get('name', '')}: {part}: {type(error).__name__} {error}") from None
        except ValueError as error:
            raise RigError(f"rig {fields.get('name', '')}: {part}: {error}") from None
        opened.pop_all()
    return driver

"""Who is there: the instruments of a rig asked one by one, and the ports of this machine asked what they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, TypeVar

from serial.tools import list_ports

from ertskin.hardware.clock import Clock
from ertskin.hardware.ert_readers.link import identity_at
from ertskin.hardware.failure import InstrumentError
from ertskin.hardware.instrument import ErtReader, LoadCell
from ertskin.hardware.load_cells.futek import parse_futek
from ertskin.hardware.load_cells.hx711 import LAYOUTS, parse_hx711
from ertskin.hardware.load_cells.mark10 import parse_mark10
from ertskin.hardware.rig import open_load_cell, open_reader, open_stage
from ertskin.hardware.stages.grbl import parse_status
from ertskin.hardware.stages.marlin import parse_position
from ertskin.hardware.transport import Lines, SerialTransport
from ertskin.physics.protocol import Protocol

T = TypeVar("T")

LISTEN_S = 2.5
"""Long enough for a board that restarts when its port is opened."""
ANSWER_S = 0.8


@dataclass(frozen=True)
class Answer:
    """What one instrument, or one port, said: ``well`` if it can be used."""

    where: str
    what: str
    well: bool


def ask_rig(fields: Mapping[str, Any], protocol: Protocol, clock: Clock) -> list[Answer]:
    """Have every instrument of a rig, described as for ``open_rig``, name itself and give one value. Nothing moves."""
    return [
        _asked("stage", lambda: open_stage(fields, clock), lambda stage: stage.identify()),
        _asked("load cell", lambda: open_load_cell(fields, clock), _one_sample),
        _asked(
            "ERT reader",
            lambda: open_reader(fields, clock, protocol.shape),
            lambda reader: _one_scan(reader, protocol, clock),
        ),
    ]


def _asked(where: str, opened: Callable[[], T], question: Callable[[T], str]) -> Answer:
    try:
        with closing(opened()) as instrument:  # type: ignore[type-var]
            return Answer(where, question(instrument), True)
    except InstrumentError as error:
        return Answer(where, str(error), False)


def _one_sample(cell: LoadCell) -> str:
    return f"{cell.identify()}, {cell.force(2.0).force_n:.3f} N untared"


def _one_scan(reader: ErtReader, protocol: Protocol, clock: Clock) -> str:
    name = reader.identify()
    reader.start()
    clock.sleep(protocol.scan_s or 0.0)
    scan = reader.finish(4.0)
    injections, readings = scan.voltage_v.shape
    return f"{name}, a scan of {injections}x{readings}, largest reading {scan.voltage_v.max():.3f} V"


def ports() -> list[tuple[str, str]]:
    """(device, what the system knows of it) of this machine's serial ports, USB identifiers as a rig takes them."""
    found = []
    for item in list_ports.comports():
        usb = f"usb:{item.vid:04x}:{item.pid:04x}" if item.vid is not None and item.pid is not None else ""
        number = f":{item.serial_number}" if usb and item.serial_number else ""
        found.append((str(item.device), f"{usb}{number} {item.description or ''}".strip()))
    return sorted(found)


def discover(names: Iterable[str], clock: Clock) -> list[Answer]:
    """Ask ports what they are. Questions are those the drivers ask; none makes a stage move."""
    return [_port(name, clock) for name in names]


def _port(name: str, clock: Clock) -> Answer:
    said = ""
    try:
        for baud, questions in QUESTIONS.items():
            line = SerialTransport(name, baud, clock)
            try:
                for question in questions:
                    said = question(line)
                    if said:
                        return Answer(name, f"{said} at {baud} baud", True)
            finally:
                line.close()
    except InstrumentError as error:
        return Answer(name, str(error), False)
    return Answer(name, "answers nothing that a driver knows", False)


def _heard(line: SerialTransport) -> str:
    """What sends without being asked."""
    lines = Lines(line)
    deadline = line.clock.now() + LISTEN_S
    lines.next(LISTEN_S)
    while (text := lines.next(deadline - line.clock.now())) is not None:
        for name, recognised in STREAMS.items():
            if recognised(text):
                return name
    return ""


def _answered(question: bytes, recognised: Callable[[str], str]) -> Callable[[SerialTransport], str]:
    def ask(line: SerialTransport) -> str:
        lines = Lines(line)
        lines.discard()
        line.write(question)
        deadline = line.clock.now() + ANSWER_S
        while (text := lines.next(deadline - line.clock.now())) is not None:
            if name := recognised(text):
                return name
        return ""

    return ask


def _link(line: SerialTransport) -> str:
    identity = identity_at(line, ANSWER_S)
    return "" if identity is None else f"link: {identity.name} {identity.serial}"


def _fields(text: str) -> int:
    """How many numbers with a decimal point a line of commas holds; 0 where it holds anything else."""
    parts = [part.strip() for part in text.rstrip(",").split(",")]
    try:
        [float(part) for part in parts]
    except ValueError:
        return 0
    return len(parts) if all("." in part for part in parts) else 0


STREAMS: dict[str, Callable[[str], object]] = {
    "grbl": lambda text: text.startswith("Grbl 1.1"),
    "marlin": lambda text: text.startswith("echo:Marlin"),
    "spectra": lambda text: text.startswith("magnitudes"),
    "eit_kit": lambda text: _fields(text) >= 16,
    "futek": lambda text: parse_futek(text) is not None,
    **{
        f"hx711 ({layout})": (lambda text, layout=layout: parse_hx711(text, layout, "N") is not None)  # type: ignore[misc]
        for layout in LAYOUTS
    },
}
"""How a line that comes unasked is recognised, by the driver's name."""

# The same request to a gauge and to GRBL: one without its end would spoil the gauge's next.
_ASK_VALUE = _answered(
    b"?\r", lambda text: "grbl" if parse_status(text) else "mark10" if parse_mark10(text) is not None else ""
)
_ASK_MARLIN = _answered(b"M114\n", lambda text: "marlin" if parse_position(text) is not None else "")
QUESTIONS: dict[int, tuple[Callable[[SerialTransport], str], ...]] = {
    115_200: (_heard, _ASK_VALUE, _ASK_MARLIN, _link),
    921_600: (_link,),
    250_000: (_ASK_MARLIN,),
    9_600: (_heard, _ASK_VALUE),
}
"""What is asked at which baud rate, in this order."""

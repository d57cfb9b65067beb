"""Ports by name and by USB identifiers, lost and found again."""

from __future__ import annotations

import os
from types import SimpleNamespace

import pytest
import serial.tools.list_ports

from ertskin.hardware import clock
from ertskin.hardware.failure import InstrumentError, LostContact
from ertskin.hardware.transport import SerialTransport, find_port
from ertskin.hardware.virtual.fault_trial import small_bench


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three USB devices, two of one kind."""
    found = [("/dev/a", 0x1A86, 0x7523, "1"), ("/dev/b", 0x1A86, 0x7523, "2"), ("/dev/c", 0x2341, 0x0043, None)]
    ports = [SimpleNamespace(device=d, vid=v, pid=p, serial_number=s) for d, v, p, s in found]
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: ports)


@pytest.mark.usefixtures("plugged")
def test_ports_by_usb_identifiers() -> None:
    assert find_port("/dev/anything") == "/dev/anything"
    assert find_port("usb:2341:0043") == "/dev/c"
    assert find_port("usb:1a86:7523:2") == "/dev/b"
    with pytest.raises(InstrumentError, match="2 devices match"):
        find_port("usb:1a86:7523")
    with pytest.raises(LostContact, match="no such USB device"):
        find_port("usb:1a86:7523:3")


@pytest.mark.usefixtures("plugged")
@pytest.mark.parametrize("port", ["usb:", "usb:1a86", "usb:xyz:1"])
def test_identifiers_that_are_none(port: str) -> None:
    with pytest.raises(ValueError, match=port):
        find_port(port)


def test_a_line_is_lost_and_found_again() -> None:
    bench = small_bench()
    line = SerialTransport(bench.load_cell.port, 115_200, bench.clock)
    assert not line.restore(1.0)
    bench.load_cell.unplug(2.0)
    with pytest.raises(LostContact, match="lost"):
        line.read(1.0)
    with pytest.raises(LostContact, match="closed"):
        line.write(b"x")
    assert line.restore(10.0)
    assert line.read(1.0)
    line.close()
    bench.close()


def test_a_system_that_can_not_wait_for_a_port_looks_again_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "SELECTS", False)
    bench = small_bench()
    line = SerialTransport(bench.load_cell.port, 115_200, clock.SystemClock())
    begin = line.clock.now()
    assert line.read(0.2) == b""
    assert 0.2 <= line.clock.now() - begin < 5.0
    os.write(bench.load_cell.descriptor, b"1.5\n")
    assert line.read(5.0) == b"1.5\n"
    line.close()
    bench.close()

"""Emulated load cells: an HX711 behind a microcontroller, a Mark-10 gauge, a FUTEK USB cell.

Their protocols' sources are named beside the drivers, in ``ertskin.hardware.load_cells``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ertskin.hardware.virtual.terminal import DeviceClock, Terminal
from ertskin.hardware.virtual.world import World

HX711_LAYOUTS: dict[str, Callable[[float, float], str]] = {
    "counts": lambda force_n, _time_s: f"{round(force_n * 20_000.0) + 81_234}",
    "plain": lambda force_n, _time_s: f"{force_n:.3f}",
    "average": lambda force_n, _time_s: f"one reading:\t{force_n:.3f}\t| average:\t{force_n:.3f}",
    "reading": lambda force_n, _time_s: f"Reading: {force_n:.3f} N calibration_factor: -7050.00",
    "openscale": lambda force_n, time_s: f"{int(1e3 * time_s)},{force_n / 9.80665:.4f},kg,23.12,",
}
"""How a sketch writes a sample: newton and seconds to text. Raw counts are 20000 a newton around 81234."""


class StreamingScale(Terminal):
    """Writes a line per sample at an even rate."""

    def __init__(
        self, clock: DeviceClock, link: Path, world: World, rate_hz: float, write: Callable[[float, float], str]
    ) -> None:
        super().__init__(clock, link)
        self._world = world
        self._period_s = 1.0 / rate_hz
        self._write = write
        self._sample_s = clock.now()

    def power_on(self) -> None:
        """Start to sample again."""
        self._sample_s = self.clock.now() + 0.5

    def tick(self) -> None:
        """Send what has been sampled; a host that was away finds the newest."""
        now = self.clock.now()
        if now >= self._sample_s:
            self.send((self._write(self._world.force_n(now), now) + "\r\n").encode())
            self._sample_s += self._period_s * (1 + int((now - self._sample_s) / self._period_s))

    def next_s(self) -> float:
        """The next sample."""
        return self._sample_s


def hx711_scale(
    clock: DeviceClock, link: Path, world: World, layout: str = "counts", rate_hz: float = 10.0
) -> StreamingScale:
    """A bridge on an HX711."""
    return StreamingScale(clock, link, world, rate_hz, HX711_LAYOUTS[layout])


def futek_cell(clock: DeviceClock, link: Path, world: World) -> StreamingScale:
    """A FUTEK USB cell in grams, ten lines a second."""
    return StreamingScale(clock, link, world, 10.0, lambda force_n, _time_s: f"{force_n / 9.80665e-3:.3f} g")


class Mark10Gauge(Terminal):
    """Answers ``?`` with the reading."""

    def __init__(self, clock: DeviceClock, link: Path, world: World) -> None:
        super().__init__(clock, link)
        self._world = world
        self._line = bytearray()

    def power_on(self) -> None:
        """Start anew."""
        self._line.clear()

    def receive(self, data: bytes) -> None:
        """Requests end in a carriage return; a line feed is ignored."""
        for byte in data:
            if byte == 0x0D:
                request = bytes(self._line)
                self._line.clear()
                self._answer(request)
            elif byte != 0x0A and len(self._line) < 64:
                self._line.append(byte)

    def _answer(self, request: bytes) -> None:
        if request == b"?":
            force = self._world.force_n(self.clock.now())
            self.send(f"{force:.3f} N\r\n".encode(), 0.015)
        elif request:
            self.send(b"*10\r\n", 0.015)

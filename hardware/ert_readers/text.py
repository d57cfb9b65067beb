"""An ERT reader that writes a line of numbers per scan, without a checksum.

Nothing in such a line tells a damaged digit from a reading, so a scan is handed out only when the next one confirms it:
two in a row must agree within ``agreement`` everywhere but at readings that drift together. A line with too few or too
many numbers, or one that is not written as the firmware writes it, is dropped and counted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.driver import SensorDriver
from ertskin.hardware.failure import NoAnswer, Refusal
from ertskin.hardware.instrument import Scan
from ertskin.hardware.transport import Lines, Transport


class TextReader(SensorDriver):
    """Scans of ``shape`` (K,M) from lines."""

    kind = "ERT reader"

    def __init__(
        self,
        transport: Transport,
        shape: tuple[int, int],
        model: str,
        parse: Callable[[str], NDArray[np.float64] | None],
        volts_per_unit: float,
        agreement: float,
        start: bytes = b"",
    ) -> None:
        """``parse``: K*M numbers of a line or None; ``agreement``: largest difference of two scans that confirm each
        other, a share of the largest reading; ``start``: what sets the device going."""
        super().__init__(transport)
        self.shape = shape
        self.dropped = 0
        self._model = model
        self._lines = Lines(transport, longest=24 * shape[0] * shape[1] + 256)
        self._parse = parse
        self._volts_per_unit = volts_per_unit
        self._agreement = agreement
        self._start = start
        self._lost = 0

    def identify(self) -> str:
        """The model, once a whole line has come."""
        self._lines.discard()
        self._transport.write(self._start)
        try:
            self._line(self._clock.now() + 4.0)
        except NoAnswer:
            raise Refusal(f"{self._name}: sends no lines of {self.shape[0]}x{self.shape[1]} readings") from None
        return self._model

    def start(self) -> None:
        """Forget scans that began before now."""
        self._lines.discard()

    def finish(self, timeout_s: float) -> Scan:
        """The first scan begun since ``start`` that the next one confirms."""
        deadline = self._clock.now() + timeout_s
        # A line under way at ``start`` lost its beginning, and the scan behind it began before.
        self._lines.next(deadline - self._clock.now())
        began = self._clock.now()
        before = self._line(deadline)
        while True:
            ended = self._clock.now()
            values = self._line(deadline)
            scale = max(float(np.abs(before).max()), float(np.abs(values).max()))
            if float(np.abs(values - before).max()) <= self._agreement * scale:
                break
            self._lost += 1
            before, began = values, ended
        lost, self._lost = self._lost, 0
        voltage = (self._volts_per_unit * before).astype(np.float32).reshape(self.shape)
        return Scan(began, voltage, lost=lost)

    def _rejoin(self) -> None:
        self.identify()

    def _line(self, deadline: float) -> NDArray[np.float64]:
        while (line := self._lines.next(deadline - self._clock.now())) is not None:
            values = self._parse(line)
            if values is not None:
                return values
            self.dropped += 1
            self._lost += 1
        raise NoAnswer(f"{self._name}: no confirmed scan in the time allowed")


def numbers(fields: list[str], count: int, pattern: Callable[[str], object]) -> NDArray[np.float64] | None:
    """``count`` numbers, each written as ``pattern`` accepts, or None."""
    if len(fields) != count or not all(pattern(field) for field in fields):
        return None
    return np.array([float(field) for field in fields])

"""A load cell that sends a line per sample without being asked."""

from __future__ import annotations

from collections.abc import Callable

from ertskin.hardware.driver import SensorDriver
from ertskin.hardware.failure import NoAnswer, Refusal
from ertskin.hardware.instrument import Force
from ertskin.hardware.transport import Lines, Transport


class StreamingCell(SensorDriver):
    """Samples as they come; lines that don't parse are skipped and counted in ``garbled``."""

    kind = "load cell"

    def __init__(self, transport: Transport, model: str, parse: Callable[[str], float | None]) -> None:
        """``parse``: newton from a line, or None where the line is no whole sample."""
        super().__init__(transport)
        self.garbled = 0
        self._model = model
        self._lines = Lines(transport, longest=256)
        self._parse = parse
        self._joined = False

    def identify(self) -> str:
        """The model, once two samples have come; raises ``Refusal`` where none do."""
        try:
            self.force(2.0)
            self.force(2.0)
        except NoAnswer:
            raise Refusal(f"{self._name}: sends no lines of a {self._model}") from None
        return self._model

    def force(self, timeout_s: float) -> Force:
        """The next sample."""
        clock = self._clock
        deadline = clock.now() + timeout_s
        while (line := self._lines.next(deadline - clock.now())) is not None:
            # The first line after a break may have lost its beginning, and a tail can pass for a value.
            if not self._joined:
                self._joined = True
                continue
            value = self._parse(line)
            if value is not None:
                return Force(clock.now(), value)
            self.garbled += 1
        raise NoAnswer(f"{self._name}: no sample within {timeout_s:g} s")

    def discard(self) -> None:
        """Forget samples that have arrived."""
        self._lines.discard()
        self._joined = False

    def _rejoin(self) -> None:
        self.discard()

"""A line whose exact traffic is written down beforehand."""

from __future__ import annotations

from ertskin.hardware.failure import LostContact


class ScriptedClock:
    """Time that passes only by waiting."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    def sleep(self, seconds: float) -> None:
        self.time_s += max(0.0, seconds)


class ScriptedLine:
    """Expects ``(sent, answered)`` pairs in order; anything else sent fails the test."""

    name = "scripted"

    def __init__(self, *traffic: tuple[bytes, bytes], unasked: bytes = b"") -> None:
        self.clock = ScriptedClock()
        self._traffic = list(traffic)
        self._waiting = unasked
        self.lost = False

    def write(self, data: bytes) -> None:
        assert self._traffic, f"nothing more expected, but {data!r} was sent"
        sent, answer = self._traffic.pop(0)
        assert data == sent
        self._waiting += answer

    def read(self, timeout_s: float) -> bytes:
        if self.lost:
            raise LostContact("scripted: contact lost")
        data, self._waiting = self._waiting, b""
        if not data:
            self.clock.sleep(timeout_s)
        return data

    def say(self, data: bytes) -> None:
        self._waiting += data

    def discard(self) -> None:
        self._waiting = b""

    def restore(self, timeout_s: float) -> bool:
        return False

    def reopen(self) -> None:
        pass

    def close(self) -> None:
        pass

    def done(self) -> bool:
        return not self._traffic

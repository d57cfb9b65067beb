"""Bringing the stage off the skin however long that takes, and saying aloud meanwhile that it may still press."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType

from ertskin.hardware.clock import Clock
from ertskin.hardware.failure import InstrumentError

PAUSE_S = 0.5
"""Seconds between two attempts."""
WARNING_PERIOD_S = 3.0


def raise_patiently(
    attempt: Callable[[], None], clock: Clock, patience_s: float, announcement: str = ""
) -> InstrumentError | None:
    """Try to raise the stage until an ``attempt`` raises no ``InstrumentError``, for ``patience_s`` at most.

    Says the ``announcement`` on standard error, then every few seconds that the stage may still press, and once it is
    up that it is, unless nothing was said before. Returns None then, else the last attempt's error.
    """
    deadline = clock.now() + patience_s
    with _Warning(announcement) as warning:
        while True:
            try:
                attempt()
            except InstrumentError as error:
                if clock.now() >= deadline:
                    return error
                warning.because(error)
                clock.sleep(PAUSE_S)
            else:
                warning.all_clear()
                return None


def say(text: str) -> None:
    """A line on standard error, which may be gone: a terminal closed, a pipe nobody reads."""
    with suppress(OSError, ValueError):
        print(f"ertskin: {text}", file=sys.stderr, flush=True)


class _Warning:
    """Says in a thread of its own, for an attempt may take long, that the stage may still press."""

    def __init__(self, announcement: str) -> None:
        self._reason = ""
        self._said = bool(announcement)
        if announcement:
            say(announcement)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._repeat, daemon=True)

    def __enter__(self) -> _Warning:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._over.set()
        self._thread.join()

    def because(self, error: InstrumentError) -> None:
        """An attempt failed, and why: said at once the first time, then with every warning."""
        first, self._reason = not self._reason, f" ({error})"
        if first:
            self._warn()

    def all_clear(self) -> None:
        """The stage is up: said where a warning was."""
        self._over.set()
        self._thread.join()
        if self._said:
            say("the stage is up")

    def _repeat(self) -> None:
        while not self._over.wait(WARNING_PERIOD_S):
            self._warn()

    def _warn(self) -> None:
        self._said = True
        say(f"the stage may still press, trying to raise it{self._reason}")

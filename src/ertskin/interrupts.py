"""A polite request to end: SIGTERM unwinds the program like Ctrl-C does, so that what is open gets closed."""

from __future__ import annotations

import signal
import threading
from types import FrameType


class Terminated(SystemExit):
    """Raised in the main thread on SIGTERM; exit status 143."""

    def __init__(self) -> None:
        super().__init__(128 + signal.SIGTERM)


def unwind_on_sigterm() -> None:
    """From now on SIGTERM raises ``Terminated``; without effect outside the main thread."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _raise)


def _raise(number: int, frame: FrameType | None) -> None:
    raise Terminated

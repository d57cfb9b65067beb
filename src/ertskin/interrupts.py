"""A polite request to end: SIGTERM unwinds the program like Ctrl-C does, so that what is open gets closed."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType

AGAIN_S = 0.01
"""Seconds after which a request is made again that no caller saw."""


class Terminated(SystemExit):
    """Raised in the main thread on SIGTERM; exit status 143."""

    def __init__(self) -> None:
        super().__init__(128 + signal.SIGTERM)


REQUESTS: dict[type[BaseException], signal.Signals] = {
    Terminated: signal.SIGTERM,
    KeyboardInterrupt: signal.SIGINT,
}


def unwind_on_sigterm() -> None:
    """From now on SIGTERM raises ``Terminated``, and no request to end is lost; only from the main thread."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _raise)
        sys.unraisablehook = _unraisable


def _raise(number: int, frame: FrameType | None) -> None:
    raise Terminated


def _unraisable(lost: sys.UnraisableHookArgs) -> None:
    """A signal that comes within a finalizer or a callback raises where nothing can be raised: ask once more."""
    number = REQUESTS.get(lost.exc_type)
    if number is None:
        sys.__unraisablehook__(lost)
        return
    again = threading.Timer(AGAIN_S, _ask, (number,))
    again.daemon = True
    again.start()


def _ask(number: signal.Signals) -> None:
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        _thread.interrupt_main(number)  # Wakes nobody who waits for an instrument, but is all that there is.

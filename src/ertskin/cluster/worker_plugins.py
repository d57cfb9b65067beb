"""What Dask's workers do as they join: keep the memory they free, load what they will need."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from typing import Any

from distributed import WorkerPlugin

TRIM_THRESHOLD, MMAP_THRESHOLD, ARENA_MAX = -1, -3, -8  # glibc's mallopt
KEPT_BYTES = 1 << 26
LARGEST_MMAP_BYTES = 1 << 25


class LoadsModules(WorkerPlugin):
    """Sent with a piece of work, it makes a worker import what that needs before there is anything to do."""

    def __init__(self, compute: Callable[[int], Any]) -> None:
        self.compute = compute


class KeepsFreedMemory(WorkerPlugin):
    """Dask starts its workers so that freed memory goes back to the system at once; arrays pay for that with time.

    Sets glibc's thresholds to what they grow to in any other process; elsewhere than on glibc it does nothing.

    With Dask's own (64 KiB) every larger array is mapped anew and cleared page by page: synthesis took twice the CPU.
    The thread that computes shares the main thread's memory: one of its own is given back whenever it is empty.
    """

    def setup(self, worker: Any) -> None:
        """Called on each worker, also on those that join later."""
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
        if mallopt is not None:
            mallopt(MMAP_THRESHOLD, LARGEST_MMAP_BYTES)
            mallopt(TRIM_THRESHOLD, KEPT_BYTES)
            mallopt(ARENA_MAX, 1)

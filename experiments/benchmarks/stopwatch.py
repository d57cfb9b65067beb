"""Paired timings: contestants run in turn, ratios are taken within a turn, medians over the turns."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

LEAST_S = 0.05


class Stopwatch:
    """Seconds on the wall, and of CPU over all threads, between entering and leaving."""

    def __enter__(self) -> Stopwatch:
        self.wall_s, self.cpu_s = -time.perf_counter(), -time.process_time()
        return self

    def __exit__(self, *error: object) -> None:
        self.wall_s += time.perf_counter()
        self.cpu_s += time.process_time()


def paired_seconds(jobs: dict[str, Callable[[], object]], turns: int) -> dict[str, list[float]]:
    """CPU seconds of each job in each turn, after a warm-up that doesn't count.

    CPU time, on one thread: it doesn't rise when other programs share the machine as much as the clock on the wall. A
    job of milliseconds is repeated within its turn for ``LEAST_S``, the mean counts: once after a job of seconds it
    would pay for the caches that one took.
    """
    repeats = {}
    for name, job in jobs.items():
        job()
        start = time.process_time()
        job()
        repeats[name] = max(1, int(np.ceil(LEAST_S / max(time.process_time() - start, 1e-6))))
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(turns):
        for name, job in jobs.items():
            start = time.process_time()
            for _ in range(repeats[name]):
                job()
            seconds[name].append((time.process_time() - start) / repeats[name])
    return seconds


def summary(seconds: dict[str, list[float]], ours: str) -> dict[str, dict[str, float]]:
    """Median milliseconds of each job, and the median of its ratio to ours in the same turn."""
    base = np.array(seconds[ours])
    return {
        name: {"ms": 1e3 * float(np.median(each)), "ratio": float(np.median(np.array(each) / base))}
        for name, each in seconds.items()
    }

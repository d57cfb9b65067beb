"""The processor cores that this process was given, and work spread over them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

SHARE_VARIABLE = "ERTSKIN_CORES"
"""How many cores a cluster's worker may use; set by what starts it."""


def given_cores() -> int:
    """A cluster worker's share, else the cores this process may run on."""
    share = os.environ.get(SHARE_VARIABLE, "")
    if share.isdigit() and int(share) > 0:
        return int(share)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Every item's result in their order, on the cores given; an exception of the work is raised here."""
    several = items if isinstance(items, Sized) else list(items)
    threads = min(given_cores(), len(several))
    if threads <= 1:
        return [work(item) for item in several]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, several))


def in_threads_by_turns(work: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
    """``in_threads`` where results are large: no more of them at once than there are cores."""
    cores = given_cores()
    for first in range(0, len(items), cores):
        yield from in_threads(work, items[first : first + cores])

"""Worker processes of this machine, one BLAS thread each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_all_start_methods, get_context, get_start_method, set_start_method
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from ertskin.cores import SHARE_VARIABLE, given_cores
from ertskin.errors import JobFailed

Result = TypeVar("Result")
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
MOST_LOSSES = 3

_compute: Callable[[int], Any] | None = None


@dataclass(frozen=True)
class LocalCluster:
    """``workers`` processes; 0 takes one per core. A single worker works in this process.

    A process that dies takes the others with it, as Python's pools do; what they had not finished is begun again.
    """

    workers: int = 0

    def spread(self, compute: Callable[[int], Result], numbers: Iterable[int]) -> Iterator[tuple[int, Result]]:
        """Yield ``(number, compute(number))`` as done; an exception in a worker is raised here.

        Raises ``JobFailed`` where processes died ``MOST_LOSSES`` times.
        """
        todo = list(numbers)
        workers = min(self.workers or given_cores(), len(todo))
        if workers <= 1:
            for number in todo:
                # Not held while the caller has the word: the limit is the whole process's, and the bits of a caller's
                # products depend on it. Nor given back whenever a forgotten generator happens to be collected.
                with threadpool_limits(1):
                    result = compute(number)
                yield number, result
            return
        prepare(compute)
        losses = 0
        while todo:
            try:
                for number, result in _pooled(compute, todo, workers):
                    todo.remove(number)
                    yield number, result
            except BrokenProcessPool:
                losses += 1
                if losses == MOST_LOSSES:
                    raise JobFailed("worker processes keep dying, perhaps for want of memory") from None


def prepare(compute: Callable[[int], Any]) -> None:
    """Let it build what it should travel with, with one BLAS thread as everywhere."""
    with threadpool_limits(1):
        getattr(compute, "prepare", _nothing)()


def _nothing() -> None: ...


def _pooled(compute: Callable[[int], Result], todo: list[int], workers: int) -> Iterator[tuple[int, Result]]:
    if get_start_method(allow_none=True) not in (None, *get_all_start_methods()):
        # In a worker of another launcher (loky's) it is that one's own, which a fresh interpreter doesn't know.
        set_start_method("spawn", force=True)
    with _one_thread_each(workers), ProcessPoolExecutor(workers, get_context("spawn"), _remember, (compute,)) as pool:
        waiting = {pool.submit(_call, number): number for number in todo}
        try:
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _one_thread_each(workers: int) -> Iterator[None]:
    """Set before a child loads its BLAS: threads of two busy processes fight. Each gets its share of the cores."""
    before = {name: os.environ.get(name) for name in (*THREAD_VARIABLES, SHARE_VARIABLE)}
    os.environ.update({**dict.fromkeys(THREAD_VARIABLES, "1"), SHARE_VARIABLE: str(max(1, given_cores() // workers))})
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


def _remember(compute: Callable[[int], Any]) -> None:
    global _compute
    _compute = compute


def _call(number: int) -> Any:
    assert _compute is not None
    return _compute(number)

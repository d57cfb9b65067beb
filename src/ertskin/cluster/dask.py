"""Dask workers: started here, reached at an address, or queued on SLURM."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, TypeVar

from ertskin.errors import UserError

Result = TypeVar("Result")


@dataclass(frozen=True)
class DaskCluster:
    """Workers of a Dask scheduler.

    ``address`` of a running scheduler, or None: ``workers`` processes are started on this machine. With ``slurm``
    given (keyword arguments of ``dask_jobqueue.SLURMCluster``), ``workers`` jobs are queued instead. A worker lost
    mid-way costs its piece alone: the scheduler gives it to another.
    """

    address: str | None = None
    workers: int = 2
    slurm: dict[str, Any] | None = None

    def spread(self, compute: Callable[[int], Result], numbers: Iterable[int]) -> Iterator[tuple[int, Result]]:
        """Yield ``(number, compute(number))`` as done; ``UserError`` where Dask or its scheduler can't be had."""
        try:
            from distributed import as_completed
        except ImportError:
            raise UserError("cluster=dask needs Dask: pip install 'ertskin[cluster]'") from None
        with ExitStack() as stack:
            client = self._client(stack)
            shared = client.scatter(compute, broadcast=True)
            futures = [client.submit(_call, shared, number, pure=False, retries=2) for number in numbers]
            for future in as_completed(futures):
                yield future.result()
                future.release()

    def _client(self, stack: ExitStack) -> Any:
        from distributed import Client, LocalCluster

        if self.address is not None:
            try:
                return stack.enter_context(Client(self.address, timeout=10))
            except OSError as error:
                raise UserError(f"no Dask scheduler answers at {self.address}: {error}") from None
        if self.slurm is not None:
            cluster = stack.enter_context(_slurm(self.slurm))
            cluster.scale(jobs=self.workers)
        else:
            cluster = stack.enter_context(
                LocalCluster(n_workers=self.workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=None)
            )
        return stack.enter_context(Client(cluster))


def _slurm(settings: dict[str, Any]) -> Any:
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise UserError("cluster=slurm needs dask-jobqueue: pip install 'ertskin[cluster]'") from None
    return SLURMCluster(**settings)


def _call(compute: Callable[[int], Result], number: int) -> tuple[int, Result]:
    return number, compute(number)

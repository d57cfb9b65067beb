"""Dask workers: started here, reached at an address, or queued on SLURM."""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, TypeVar

from ertskin.cluster.local import THREAD_VARIABLES, prepare
from ertskin.cores import SHARE_VARIABLE, given_cores
from ertskin.errors import JobFailed, UserError

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
        """Yield ``(number, compute(number))`` as done; an exception in a worker is raised here.

        Raises ``UserError`` where Dask or its scheduler can't be had, ``JobFailed`` for a piece that lost four workers.
        """
        try:
            from distributed import KilledWorker, as_completed

            from ertskin.cluster.worker_plugins import KeepsFreedMemory, LoadsModules
        except ImportError:
            raise UserError("cluster=dask needs Dask: pip install 'ertskin[cluster]'") from None
        with ExitStack() as stack:
            client = self._client(stack)
            client.register_plugin(KeepsFreedMemory())
            client.register_plugin(LoadsModules(compute))
            # Workers start meanwhile.
            prepare(compute)
            # A task of its own: sent once, passed on from worker to worker, and made again where its keeper died.
            shared = client.submit(_given, compute, pure=False)
            futures = [client.submit(_call, shared, number, pure=False, priority=-number) for number in numbers]
            for future in as_completed(futures):
                try:
                    yield future.result()
                except KilledWorker as error:
                    raise JobFailed(f"workers keep dying, perhaps for want of memory: {error}") from None
                future.release()

    def _client(self, stack: ExitStack) -> Any:
        import dask
        from distributed import Client, LocalCluster

        logging.getLogger("distributed").setLevel(logging.WARNING)
        # A worker that samples its own stack a hundred times a second spends its start-up on that.
        quiet: dict[str, Any] = {"distributed.worker.profile.enabled": False}
        # Every process looks at itself fifty times a second, at the machine twice: a twentieth of the client's core.
        quiet["distributed.admin.tick.interval"], quiet["distributed.admin.tick.limit"] = "1 s", "10 s"
        quiet["distributed.admin.system-monitor.interval"] = "10 s"
        quiet["distributed.worker.memory.monitor-interval"] = "500 ms"
        # What a piece of work has prepared is sent once.
        quiet["distributed.admin.large-graph-warning-threshold"] = "1 GB"
        # Dask leaves what its workers shall find in this process's own environment: no more than it should have.
        quiet["distributed.nanny.pre-spawn-environ"] = dict.fromkeys(THREAD_VARIABLES, 1)
        quiet[f"distributed.nanny.environ.{SHARE_VARIABLE}"] = max(1, given_cores() // self.workers)
        stack.enter_context(dask.config.set(quiet))
        if self.address is not None:
            try:
                return stack.enter_context(Client(self.address, timeout=10))
            except OSError as error:
                raise UserError(f"no Dask scheduler answers at {self.address}: {error}") from None
        if self.slurm is not None:
            cluster = stack.enter_context(_slurm(self.slurm))
            cluster.scale(jobs=self.workers)
        else:
            memory = 1.0 / self.workers
            local = {"threads_per_worker": 1, "memory_limit": memory, "host": "127.0.0.1", "dashboard_address": None}
            cluster = stack.enter_context(LocalCluster(n_workers=0, **local))
            cluster.scale(self.workers)
        return stack.enter_context(Client(cluster))


def _slurm(settings: dict[str, Any]) -> Any:
    interrupted = signal.getsignal(signal.SIGINT)
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise UserError("cluster=slurm needs dask-jobqueue: pip install 'ertskin[cluster]'") from None
    finally:
        # Imported, it makes Ctrl-C a silent exit for good.
        signal.signal(signal.SIGINT, interrupted)
    return SLURMCluster(**settings)


def _given(compute: Callable[[int], Result]) -> Callable[[int], Result]:
    return compute


def _call(compute: Callable[[int], Result], number: int) -> tuple[int, Result]:
    return number, compute(number)

"""A stage trained in a process of its own while another is trained here."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait

from ertskin.errors import JobFailed
from ertskin.training.progress import Log
from ertskin.training.stage import Stage


@contextmanager
def trained_in_child(stage: Stage, log: Log) -> Iterator[Callable[[], None]]:
    """Train ``stage`` in a child, which leaving this context waits for; its checkpoints stay in its folder.

    Gives what to call now and then: it logs the child's epochs up to now. However the child ended, ``stage.fit``
    afterwards reads what it trained, goes on with it, or meets its error. A child whose parent has died stops at its
    next epoch; one whose parent fails is stopped.
    """
    context = get_context("spawn")
    hears, tells = context.Pipe(duplex=False)
    child = context.Process(target=_train, args=(stage, tells), daemon=True)
    child.start()
    tells.close()

    def log_epochs() -> None:
        with suppress(EOFError):
            while hears.poll():
                log(*hears.recv())

    try:
        yield log_epochs
        while child.is_alive():
            wait([hears, child.sentinel])
            log_epochs()
    finally:
        child.terminate()
        child.join()
        hears.close()


def _train(stage: Stage, tells: Connection) -> None:
    # Ctrl-C reaches every process of a terminal; the parent ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(BrokenPipeError, JobFailed):
        stage.fit(lambda metrics, epoch: tells.send((metrics, epoch)))

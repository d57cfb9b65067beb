"""One command of ours run as a person would type it, from within another."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from ertskin.cores import SHARE_VARIABLE
from ertskin.errors import JobFailed, StepRefused

REFUSED = 2
"""Exit status of a command whose request or recording can't be used."""
LOOK_S = 0.5
"""Seconds between looks at what the steps in the background say."""
PATIENCE_S = 10.0
"""Seconds in which a step in the background may end by itself before it is killed."""


def run_step(words: list[str], cores: int | None = None) -> None:
    """Run it, on so many ``cores`` or all, and let it speak; raises ``StepRefused``, ``JobFailed``, or
    ``KeyboardInterrupt`` if it was stopped."""
    print(f"\n$ ertskin {shlex.join(words)}", flush=True)
    _judge(words, subprocess.run(_command(words), env=_environment(cores), check=False).returncode)


@contextmanager
def meanwhile(steps: Sequence[list[str]], log: Path, cores: int) -> Iterator[threading.Thread]:
    """Run ``steps`` one after another on so many ``cores`` while the caller goes on; what they say is kept in ``log``.
    Yields the thread that runs them, alive for as long as they do.

    At the end they are waited for, and print what they said; what ``run_step`` would have raised is raised then. They
    are stopped if the caller fails.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    print(f"\nmeanwhile, saying in {log} what becomes of it:", flush=True)
    print("\n".join(f"$ ertskin {shlex.join(words)}" for words in steps), flush=True)
    with log.open("w", encoding="utf-8") as into:
        background = _Background(steps, into, cores)
        background.start()
        try:
            yield background
            with log.open(encoding="utf-8", errors="replace") as said:  # A character may be half written yet.
                while background.is_alive():
                    print(said.read(), end="", flush=True)
                    background.join(LOOK_S)
                print(said.read(), end="", flush=True)
        finally:
            background.stop()
    if background.failure is not None:
        raise background.failure


class _Background(threading.Thread):
    """Runs steps until one fails; ``failure`` says which."""

    def __init__(self, steps: Sequence[list[str]], into: TextIO, cores: int) -> None:
        super().__init__(name="steps", daemon=True)
        self.steps, self.into, self.cores = steps, into, cores
        self.failure: BaseException | None = None
        self._stopped = threading.Event()
        self._running: subprocess.Popen[bytes] | None = None
        self._starting = threading.Lock()

    def run(self) -> None:
        try:
            for words in self.steps:
                self._run(words)
        except BaseException as error:  # Raised where the steps are waited for.
            self.failure = error

    def _run(self, words: list[str]) -> None:
        self.into.write(f"\n$ ertskin {shlex.join(words)}\n")
        self.into.flush()
        with self._starting:
            if self._stopped.is_set():
                return
            environment = _environment(self.cores)
            output = {"stdout": self.into, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL}
            self._running = subprocess.Popen(_command(words), env=environment, **output)  # type: ignore[call-overload]
        _judge(words, self._running.wait())

    def stop(self) -> None:
        """End what runs, politely first; nothing else is started."""
        with self._starting:
            self._stopped.set()
        if self._running is not None and self._running.poll() is None:
            _end(self._running)
        self.join()


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process, and the workers it leaves behind if it has to be killed."""
    import psutil

    try:
        workers = psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return
    process.terminate()
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
    for worker in workers:
        with suppress(psutil.NoSuchProcess):
            worker.kill()


def _command(words: list[str]) -> list[str]:
    return [sys.executable, "-m", "ertskin.cli", *words]


def _environment(cores: int | None) -> dict[str, str]:
    share = {} if cores is None else {SHARE_VARIABLE: str(cores)}
    return {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", **share}


def _judge(words: list[str], status: int) -> None:
    if status in (130, -2):
        raise KeyboardInterrupt
    if status == REFUSED:
        raise StepRefused(f"refused: ertskin {shlex.join(words)}")
    if status:
        raise JobFailed(f"the step above ended with status {status}: ertskin {shlex.join(words)}")

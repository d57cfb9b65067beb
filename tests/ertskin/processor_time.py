"""What a command takes of a processor, its children with it."""

from __future__ import annotations

import resource
import subprocess
import sys


def command_s(*arguments: str, tries: int = 3) -> float:
    """Seconds of processor time of ``ertskin ARGUMENTS``, the least of some tries: neighbours only ever add to it."""
    return min(_once_s(arguments) for _ in range(tries))


def _once_s(arguments: tuple[str, ...]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "ertskin.cli", *arguments], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

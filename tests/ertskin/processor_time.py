"""What a command takes of a processor, its children with it."""

from __future__ import annotations

import resource
import subprocess
import sys


def command_s(*arguments: str, tries: int = 3) -> float:
    """Seconds of processor time of ``ertskin ARGUMENTS``, the least of some tries: neighbours only ever add to it."""
    return min(_once_s("-m", "ertskin.cli", *arguments) for _ in range(tries))


def light_imports_s(tries: int = 3) -> float:
    """Seconds of processor time of what every command imports, on this machine and as busy as it is just now."""
    return min(_once_s("-c", "import hydra.utils, h5py, rich.console") for _ in range(tries))


def _once_s(*arguments: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

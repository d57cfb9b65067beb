"""Whether the process that began a run still lives."""

from __future__ import annotations

import os
import socket

import psutil

HOST_TAG, PROCESS_TAG = "ertskin.host", "ertskin.process"


def own_tags() -> dict[str, str]:
    """Tags that name this process for good: a process number alone is given out again."""
    return {HOST_TAG: socket.gethostname(), PROCESS_TAG: _name(psutil.Process(os.getpid()))}


def is_gone(tags: dict[str, str]) -> bool:
    """Whether the process the tags name has ended; one on another machine is taken to live."""
    if tags.get(HOST_TAG) != socket.gethostname():
        return False
    number = tags.get(PROCESS_TAG, "").partition("@")[0]
    try:
        return _name(psutil.Process(int(number))) != tags[PROCESS_TAG]
    except (psutil.NoSuchProcess, ValueError):
        return True


def _name(process: psutil.Process) -> str:
    return f"{process.pid}@{process.create_time():.2f}"

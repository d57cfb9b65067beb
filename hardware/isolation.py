"""Reads recording files in a process of its own: on damaged bytes the HDF5 library may loop for ever or crash."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from ertskin.hardware import clean_copy
from ertskin.hardware.clean_copy import CannotOpen, CannotRead

STALLED_S = 60.0
"""Beyond the processor time allowed: a disk or a busy machine may keep a sound file waiting."""


def isolated_copy(path: Path) -> bytes:
    """The image of a clean copy of the recording at ``path``; this process never sees the file's own bytes.

    Raises ``CannotOpen`` or ``CannotRead``, the latter also where the library crashes or doesn't come to an end.
    """
    # The copy is made by the file alone, and -P keeps its neighbours from being taken for other modules.
    command = [sys.executable, "-P", clean_copy.__file__, str(path)]
    allowed_s = clean_copy.processor_s(path.stat().st_size)
    surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
    # Through a file: a pipe hands tens of megabytes over in hundreds of pieces.
    with tempfile.TemporaryFile() as image:
        try:
            done = subprocess.run(
                command,
                stdout=image,
                stderr=subprocess.PIPE,
                env=surroundings,
                timeout=allowed_s + STALLED_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise CannotRead("the HDF5 library comes to no end") from None
        if done.returncode == 0:
            image.seek(0)
            return image.read()
    said = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if done.returncode == clean_copy.CANNOT_OPEN:
        raise CannotOpen(said[-1])
    if done.returncode == clean_copy.CANNOT_READ:
        raise CannotRead(said[-1])
    raise CannotRead(f"the HDF5 library crashes or comes to no end, status {done.returncode}")

"""Whether this machine has the accelerator that is asked for, told without loading torch."""

from __future__ import annotations

import ctypes
import importlib.util
import platform
import runpy
from pathlib import Path

from ertskin.errors import UserError


def check_accelerator(name: str) -> None:
    """Raise ``UserError`` for ``gpu`` where torch could not use one."""
    if name != "gpu":
        return
    if missing := _lacking():
        raise UserError(f"trainer.accelerator=gpu: {missing}; trainer.accelerator=auto takes a GPU where there is one")


def _lacking() -> str | None:
    """What a GPU lacks, as far as can be told here: where there is a driver, torch has the last word."""
    if platform.system() == "Darwin":
        return "Apple's GPUs have no double precision, in which networks keep their tables"
    found = importlib.util.find_spec("torch")
    assert found is not None
    assert found.origin is not None
    built = runpy.run_path(str(Path(found.origin).with_name("version.py")))
    if built.get("hip"):
        return None
    if built.get("cuda") is None:
        return f"torch {built['__version__']} is built for the CPU alone"
    return None if _cuda_devices() else "no GPU answers"


def _cuda_devices() -> int:
    """How many the driver counts; none without a driver."""
    library = "nvcuda.dll" if platform.system() == "Windows" else "libcuda.so.1"
    try:
        driver = ctypes.CDLL(library)
    except OSError:
        return 0
    count = ctypes.c_int(0)
    ready = driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0
    return count.value if ready else 0

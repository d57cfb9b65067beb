"""What runs where: every module but the virtual bench's terminals is imported without what Windows lacks."""

from __future__ import annotations

import subprocess
import sys

POSIX_ONLY = ["fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"]
"""Python's modules that Windows lacks. Other people's packages have theirs instead, and are imported before."""
PACKAGES = "h5py hydra lightning.pytorch matplotlib.pyplot mlflow numba onnxruntime rich scipy serial torch distributed"
ON_PSEUDO_TERMINALS = {
    f"ertskin.hardware.virtual.{name}"
    for name in ("ert_readers", "fault_trial", "grbl", "load_cells", "marlin", "rig", "serving", "terminal")
}
"""The emulated instruments, and what drives them."""
SCRIPT = f"""
import contextlib, importlib, pkgutil, sys
for name in {PACKAGES.split()}:
    with contextlib.suppress(ImportError):
        importlib.import_module(name)
for name in {POSIX_ONLY}:
    sys.modules[name] = None
import ertskin
for module in pkgutil.walk_packages(ertskin.__path__, "ertskin."):
    try:
        importlib.import_module(module.name)
    except ModuleNotFoundError as error:
        print(module.name, error.name)
    else:
        print(module.name)
"""


def test_every_module_is_imported_without_what_windows_lacks() -> None:
    ended = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True, timeout=300)
    lacking = dict(line.split() for line in ended.stdout.splitlines() if " " in line)
    without_dask = {name for name, lacked in lacking.items() if lacked == "distributed"}
    assert set(lacking) - without_dask == ON_PSEUDO_TERMINALS
    assert {lacking[name] for name in ON_PSEUDO_TERMINALS} == {"pty"}
    assert len(ended.stdout.splitlines()) > 200

"""One command of ours run as a person would type it, from within another."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys

from ertskin.errors import JobFailed, StepRefused

REFUSED = 2
"""Exit status of a command whose request or recording can't be used."""


def run_step(words: list[str]) -> None:
    """Run it and let it speak; raises ``StepRefused``, ``JobFailed``, or ``KeyboardInterrupt`` if it was stopped."""
    print(f"\n$ ertskin {shlex.join(words)}", flush=True)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    status = subprocess.run([sys.executable, "-m", "ertskin.cli", *words], env=environment, check=False).returncode
    if status in (130, -2):
        raise KeyboardInterrupt
    if status == REFUSED:
        raise StepRefused(f"refused: ertskin {shlex.join(words)}")
    if status:
        raise JobFailed(f"the step above ended with status {status}: ertskin {shlex.join(words)}")

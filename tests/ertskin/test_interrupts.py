"""Requests to end."""

from __future__ import annotations

import subprocess
import sys

import pytest

WITHIN_A_FINALIZER = """
import signal, time
from ertskin.interrupts import unwind_on_sigterm

class Asked:
    def __del__(self):
        signal.raise_signal(signal.{name})

unwind_on_sigterm()
asked = Asked()
del asked
time.sleep(60)
print("went on")
"""


@pytest.mark.parametrize(("name", "status"), [("SIGTERM", 143), ("SIGINT", -2)])
def test_a_request_within_a_finalizer_is_not_lost(name: str, status: int) -> None:
    program = WITHIN_A_FINALIZER.format(name=name)
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=50)
    assert ended.returncode == status
    assert "went on" not in ended.stdout
    assert "Exception ignored" not in ended.stderr


def test_other_lost_exceptions_are_still_said() -> None:
    program = WITHIN_A_FINALIZER.format(name="SIGTERM").replace("signal.raise_signal(signal.SIGTERM)", "1 / 0")
    ended = subprocess.run([sys.executable, "-c", program.replace("60", "0")], capture_output=True, text=True)
    assert "ZeroDivisionError" in ended.stderr
    assert "went on" in ended.stdout

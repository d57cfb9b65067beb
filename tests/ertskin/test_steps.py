"""Commands run as steps of another, one after another or meanwhile."""

import subprocess
import sys
import time

import psutil
import pytest

from ertskin import steps
from ertskin.errors import StepRefused


@pytest.fixture
def commands(monkeypatch):
    """Steps are lines of Python."""
    monkeypatch.setattr(steps, "_command", lambda words: [sys.executable, "-c", *words])


def test_steps_run_meanwhile_in_their_order_and_say_so_at_the_end(commands, tmp_path, capfd):
    log = tmp_path / "log" / "background.txt"
    slow = ["import time; time.sleep(0.5); print('first')"]
    cores = ["import os; print('second on', os.environ['ERTSKIN_CORES'])"]
    with steps.meanwhile([slow, cores], log, cores=3):
        steps.run_step(["print('foreground')"])
    said = capfd.readouterr().out
    assert said.index("foreground\n") < said.index("\nfirst\n") < said.index("\nsecond on 3\n")
    assert "second on 3" in log.read_text()


def test_a_step_that_is_refused_meanwhile_ends_the_others_and_is_raised_at_the_end(commands, tmp_path):
    done, never = tmp_path / "done", tmp_path / "never"

    def caller():
        with steps.meanwhile([["import sys; sys.exit(2)"], writing(never)], tmp_path / "log", cores=1):
            done.touch()

    with pytest.raises(StepRefused, match=r"sys\.exit"):
        caller()
    assert done.exists()
    assert not never.exists()


def test_steps_end_with_the_caller(commands, tmp_path):
    number, never = tmp_path / "number", tmp_path / "never"
    waits = [f"import os, time; open({str(number)!r}, 'w').write(str(os.getpid())); time.sleep(60)"]

    def caller():
        with steps.meanwhile([waits, writing(never)], tmp_path / "log", cores=1):
            while not number.is_file() or not number.read_text():
                time.sleep(0.01)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        caller()
    assert subprocess.run(["kill", "-0", number.read_text()], capture_output=True, check=False).returncode != 0
    assert not never.exists()


def test_a_step_that_will_not_end_is_killed_with_its_workers(commands, tmp_path, monkeypatch):
    monkeypatch.setattr(steps, "PATIENCE_S", 0.5)
    numbers = tmp_path / "numbers"
    worker = "import time; time.sleep(60)"
    stubborn = f"""
import os, signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
worker = subprocess.Popen([sys.executable, "-c", {worker!r}])
open({str(numbers)!r}, "w").write(f"{{os.getpid()}} {{worker.pid}}\\n")
time.sleep(60)
"""

    def caller():
        with steps.meanwhile([[stubborn]], tmp_path / "log", cores=1):
            while not numbers.is_file() or not numbers.read_text().endswith("\n"):
                time.sleep(0.01)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        caller()
    deadline = time.monotonic() + 20  # A kill is certain, not instant.
    while any(map(_runs, map(int, numbers.read_text().split()))):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _runs(number):
    try:
        return psutil.Process(number).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def writing(path):
    return [f"open({str(path)!r}, 'w')"]

"""The clock of a recording: waits, however long, show that who waits lives."""

from __future__ import annotations

from itertools import pairwise

import pytest

from ertskin.hardware import clock
from ertskin.hardware.clock import SIGN_S, SystemClock


class QuietPort:
    """A port nothing comes from."""

    in_waiting = 0

    def fileno(self) -> int:
        return 0


@pytest.fixture
def signs(monkeypatch: pytest.MonkeyPatch) -> tuple[SystemClock, list[float]]:
    """A clock of a machine whose time passes in waits alone, and when it gave a sign."""
    time_s, given = [0.0], []

    def pass_by(seconds: float) -> None:
        time_s[0] += seconds

    def nothing_comes(_ports: object, _out: object, _odd: object, timeout_s: float) -> tuple[list[int], ...]:
        pass_by(timeout_s)
        return [], [], []

    monkeypatch.setattr(clock.time, "monotonic", lambda: time_s[0])
    monkeypatch.setattr(clock.time, "sleep", pass_by)
    monkeypatch.setattr(clock.select, "select", nothing_comes)
    system = SystemClock()
    system.sign_of_life = lambda: given.append(time_s[0])
    return system, given


def longest_silence_s(given: list[float]) -> float:
    """Between two signs."""
    return max(after - before for before, after in pairwise(given))


@pytest.mark.parametrize("selects", [True, False])
@pytest.mark.parametrize("seconds", [0.0, 0.3, 90.5])
def test_a_wait_gives_a_sign_every_second_and_lasts_as_long_as_it_should(
    signs: tuple[SystemClock, list[float]], monkeypatch: pytest.MonkeyPatch, seconds: float, selects: bool
) -> None:
    system, given = signs
    monkeypatch.setattr(clock, "SELECTS", selects)
    assert not system.wait_readable(QuietPort(), seconds)
    waited_s = given[-1] - given[0]
    assert waited_s == pytest.approx(max(0.0, seconds), abs=SIGN_S + 1e-6)
    system.sleep(seconds)
    assert longest_silence_s(given) <= SIGN_S + 1e-6


def test_waits_end_in_time(signs: tuple[SystemClock, list[float]]) -> None:
    system, _ = signs
    for wait in (system.sleep, lambda seconds: system.wait_readable(QuietPort(), seconds)):
        begin = system.now()
        wait(7.25)
        assert system.now() - begin == pytest.approx(7.25)

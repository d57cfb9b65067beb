"""Ports asked what they are, and rigs whether they answer."""

from __future__ import annotations

import pytest

from ertskin.hardware.discovery import ask_rig, discover
from ertskin.hardware.rig import RigError, open_rig
from ertskin.hardware.virtual.fault_trial import small_bench


@pytest.mark.parametrize(
    ("stage", "load_cell", "reader"),
    [("grbl", "hx711", "link"), ("marlin", "mark10", "spectra"), ("grbl", "futek", "eit_kit")],
)
def test_every_device_is_recognised(stage: str, load_cell: str, reader: str) -> None:
    bench = small_bench(stage, load_cell, reader)
    answers = discover([bench.stage.port, bench.load_cell.port, bench.reader.port], bench.clock)
    for answer, name in zip(answers, (stage, load_cell, reader), strict=True):
        assert answer.well
        assert answer.what.startswith(name)
    bench.close()


def test_a_silent_port_and_an_absent_one() -> None:
    bench = small_bench()
    bench.reader.receive = lambda _data: None
    answers = discover([bench.reader.port, "/nowhere"], bench.clock)
    assert [answer.well for answer in answers] == [False, False]
    assert "nothing" in answers[0].what
    assert "can't be opened" in answers[1].what
    bench.close()


def test_a_rig_answers_or_says_who_does_not() -> None:
    bench = small_bench()
    protocol = bench.world.skin.protocol
    assert all(answer.well for answer in ask_rig(bench.fields, protocol, bench.clock))
    bench.load_cell.unplug()
    answers = ask_rig(bench.fields, protocol, bench.clock)
    assert [answer.well for answer in answers] == [True, False, True]
    assert "can't be opened" in answers[1].what
    bench.close()


def test_a_description_that_makes_no_sense_is_reported_in_a_line() -> None:
    bench = small_bench()
    for part, changed, expected in (
        ("stage", {"driver": "abacus"}, "abacus"),
        ("stage", {"travel_low_m": None}, "stage"),
        ("load_cell", {"layout": "prose"}, "prose"),
        ("ert_reader", {"driver": "eit_kit"}, "28 x 8"),
        ("limits", {"hang_s": 1.0}, "limits.hang_s: found 1 s, expected at least 5 s"),
    ):
        fields = {**bench.fields, part: {**bench.fields[part], **changed}}
        with pytest.raises(RigError, match=expected):
            open_rig(fields, bench.world.skin.sensor, bench.world.skin.protocol, bench.clock)
    # Every port was let go of.
    bench.open().close()
    bench.close()

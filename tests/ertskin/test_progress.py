"""Where there is no terminal, each step of a long work has a line of its own."""

from __future__ import annotations

import pytest

from ertskin.progress import saying


def test_steps_are_named_as_they_begin(capsys: pytest.CaptureFixture[str]) -> None:
    with saying("evaluating") as say:
        say("loading")
        assert capsys.readouterr().err == "evaluating: loading\n"
        say("paper [with effects]")
    assert capsys.readouterr() == ("", "evaluating: paper [with effects]\n")

"""The terminal's tables of a diagnosis: every number whole in eighty columns."""

from __future__ import annotations

import io

from rich.console import Console

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, Estimate, HeldOut
from ertskin.diagnosis.output.summary import print_retrained, print_summary
from ertskin.physics.effects.indenter_offset import IndenterOffset

LONG = "contacts (with sheet_inhomogeneity, piezo_hysteresis)"


def test_numbers_of_an_effect_are_whole() -> None:
    estimate = Estimate(-5.005e-5, -5.106e-5, -4.905e-5, "1/s")
    parameters = {"fractional_change": estimate, "fractional_change_per_second": estimate}
    claim = Claim(IndenterOffset(dx_m=1e-3), 0.97, 12.8, parameters, ())
    stream = io.StringIO()
    held = HeldOut("9 presses", 2e-3, 2.1, 1.01, 1e-12)
    print_summary(Console(file=stream, width=80), Diagnosis("skin.h5", "explained", held, claims=(claim,)))
    words = stream.getvalue().split()
    for number in ("0.97", "12.8", "-5.005e-05", "[-5.106e-05,", "-4.905e-05]"):
        assert number in words
    assert "…" not in stream.getvalue()


def test_numbers_of_networks_trained_again_are_whole() -> None:
    found = {LONG: {"force_rmse_one_n": 0.1234, "force_correlation_one": 0.9876}}
    stream = io.StringIO()
    print_retrained(Console(file=stream, width=80), {"without": found, "with": found})
    words = stream.getvalue().split()
    assert [words.count(one) for one in ("0.1234", "0.9876", "force_correlation_one")] == [2, 2, 1]
    assert max(map(len, stream.getvalue().splitlines())) <= 80

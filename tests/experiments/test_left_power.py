"""To what power what a name explains says how sure it is, by what is committed."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest
from judged import Judged
from left_power import Lowered, likely, lowered, squared

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"


def case(name: str, **took: float) -> Judged:
    """A claim at 0.8 of which each rule took a share."""
    reasons, value = [], 0.8
    for rule, share in took.items():
        reasons.append({"rule": rule, "before": value, "after": value * share, "why": ""})
        value *= share
    claim = {"name": name, "confidence": value, "reasons": reasons}
    hidden = {"name": "piezo_creep", "form": "burgers", "own": 1.5, "details": {}, "meaning": {}, "listed": True}
    return Judged("c000", {"kind": "single", "effects": [hidden]}, {"verdict": "explained", "effects": [claim]})


def test_claims_that_left_a_misfit_are_those_counted() -> None:
    cases = [
        case("piezo_creep", rivals=0.9, left_over=0.5),
        case("crosstalk", left_over=0.5, left_beyond=0.4),
        case("sheet_inhomogeneity", left_over=0.5),
        case("piezo_creep", mending=0.5),
    ]
    creep, crosstalk = lowered(cases)
    assert (creep.kind, creep.share, creep.said, creep.right) == ("others", 0.5, pytest.approx(0.36), True)
    assert (crosstalk.kind, crosstalk.share, crosstalk.right) == ("left_beyond", pytest.approx(0.2), False)


def test_a_power_of_one_is_what_was_said() -> None:
    claims = [Lowered("others", 0.5, 0.4, True), Lowered("others", 0.5, 0.4, False)]
    assert likely(claims, 1.0) == pytest.approx((math.log(0.4) + math.log(0.6), 0.36 + 0.16))
    assert likely(claims, 2.0) == pytest.approx((math.log(0.2) + math.log(0.8), 0.64 + 0.04))


def test_the_command_prints_a_committed_samples_powers() -> None:
    command = [sys.executable, CONCEALED / "proof/left_power.py", CONCEALED / "results/thirtysecond48"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "| others | 0 | 3 | 8 | 4 to 8 | -2.8, 1.0 | -1.6, 0.6 |" in ran.stdout.splitlines()
    assert "| families: unexplained or partly, no wrong name | 7/10 | 9/10 |" in ran.stdout.splitlines()


def test_shares_of_claims_that_are_no_fields_are_squared() -> None:
    creep, field = squared(case("piezo_creep", left_over=0.5)), squared(case("sheet_inhomogeneity", left_over=0.5))
    assert creep.claims[0]["confidence"] == pytest.approx(0.2)
    assert field.claims[0]["confidence"] == pytest.approx(0.4)

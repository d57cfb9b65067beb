"""How far the sheet seems not to feel a foam's force, by what is committed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from felt_share import felt_shares
from judged import Judged

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"


def case(value: float, low: float, high: float, confidence: float = 0.9, hidden: str = "nonlinear_foam") -> Judged:
    truth: dict[str, Any] = {"kind": "single", "effects": [{"name": hidden, "listed": True, "details": {}}]}
    parameters = {"carried": {"value": value, "low": low, "high": high}}
    claim = {"name": "nonlinear_foam", "confidence": confidence, "parameters": parameters}
    return Judged("c000", truth, {"verdict": "explained", "effects": [claim]})


def test_likely_foams_that_are_hidden_and_known_well_enough_count() -> None:
    cases = [
        case(0.1, -0.0645, 0.2645),
        case(0.1, -0.0645, 0.2645, confidence=0.4),
        case(0.1, -0.0645, 0.2645, hidden="foam_softening"),
        case(2.0, 0.0, 2.0),
    ]
    ((value, error),) = felt_shares(cases)
    assert (value, error) == (0.1, pytest.approx(0.1))


@pytest.mark.parametrize(
    ("sample", "says"), [("twentyseventh48", "4 foams: off by "), ("tenth16", "no foam of which that is known")]
)
def test_the_command_prints_it_of_committed_samples(sample: str, says: str) -> None:
    command = [sys.executable, CONCEALED / "proof/felt_share.py", CONCEALED / "results" / sample]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ran.stdout.startswith(says)
    assert len(ran.stdout.splitlines()) == 1

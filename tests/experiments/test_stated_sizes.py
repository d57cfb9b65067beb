"""How large effects are said to be over how large they are, by what is committed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

from judged import Judged
from stated_sizes import stated_sizes

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"


def case(claims: list[dict[str, Any]], **meaning: float) -> Judged:
    hidden = {"name": "piezo_hysteresis", "form": "preisach", "meaning": meaning, "details": {}, "listed": True}
    truth = {"kind": "single", "effects": [hidden], "point_m": []}
    return Judged("c000", truth, {"verdict": "explained", "effects": claims})


def claim(name: str, confidence: float, value: float) -> dict[str, Any]:
    quantities = {"loop_width": {"value": value, "low": 0.9 * value, "high": 1.1 * value}}
    return {"name": name, "confidence": confidence, "quantities": quantities}


def test_only_what_is_rightly_named_and_likely_counts() -> None:
    cases = [
        case([claim("piezo_hysteresis", 0.9, 0.21)], loop_width=0.2),
        case([claim("piezo_hysteresis", 0.6, 0.3)], loop_width=0.2),
        case([claim("piezo_hysteresis", 0.4, 0.5)], loop_width=0.2),
        case([claim("piezo_creep", 0.9, 0.5)], loop_width=0.2),
        case([claim("piezo_hysteresis", 0.9, 0.1)], loop_width=0.0),
        case([claim("piezo_hysteresis", 0.9, 0.1)], other=1.0),
    ]
    (found,) = stated_sizes(cases).items()
    assert found[0] == ("piezo_hysteresis", "preisach", "loop_width")
    assert [(round(one.over_true, 3), one.holds) for one in found[1]] == [(1.05, True), (1.5, False)]


def test_the_command_prints_a_committed_samples_table() -> None:
    command = [sys.executable, CONCEALED / "proof/stated_sizes.py", CONCEALED / "results/twentyninth32"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = ran.stdout.splitlines()
    assert rows[0].startswith("| name | form |")
    assert any("`piezo_inhomogeneity` | `hills` | `log_spread` | 1 |" in row for row in rows)

"""What is said of maps beside how often they are right, by what is committed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from judged import Judged
from said_of_maps import claims

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"
POINT_M = [[0.01 * column, 0.01 * row] for row in range(3) for column in range(3)]
TRUE = [0.0, 0.1, 0.0, 0.4, 0.5, 0.4, 0.0, 0.1, 0.0]


def case(value: list[float], determined: list[bool], name: str = "piezo_inhomogeneity") -> Judged:
    hidden = {"name": "piezo_inhomogeneity", "form": "hills", "meaning": {}, "details": {"map": TRUE}, "listed": True}
    truth = {"kind": "single", "effects": [hidden], "point_m": POINT_M, "presses": 9}
    taxels = {"point_m": POINT_M, "value": value, "determined": determined}
    field = {"point_m": POINT_M, "value": value, "taxels": taxels}
    claim = {"name": name, "confidence": 0.9, "confidence_everywhere": 0.3, "map": field}
    return Judged("c000", truth, {"verdict": "explained", "effects": [claim]})


def test_a_map_is_judged_over_the_sheet_and_where_it_is_known() -> None:
    wrong_in_a_corner = [*TRUE[:6], 0.9, -0.9, 0.9]
    (found,) = claims([case(wrong_in_a_corner, [True] * 6 + [False] * 3)])
    assert (found.everywhere.confidence, found.everywhere.right) == (0.3, False)
    assert (found.known.confidence, found.known.right) == (0.9, True)
    assert found.known.correlation > 0.999 > 0.8 > found.everywhere.correlation


def test_a_name_that_is_not_hidden_has_no_map_to_judge() -> None:
    assert not list(claims([case(TRUE, [True] * 9, "sheet_inhomogeneity")]))


def test_the_command_prints_a_committed_samples_maps() -> None:
    command = [sys.executable, CONCEALED / "proof/said_of_maps.py", CONCEALED / "results/twentyninth32"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = ran.stdout.splitlines()
    assert "| c022 | `piezo_inhomogeneity`, hills, 36 | 0.80 | 0.97 | 0.87 | 1.00 |" in rows
    assert "| `piezo_inhomogeneity` | over the sheet | 3 | 1.2 | 3 | 1.4 |" in rows

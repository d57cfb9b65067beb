"""What presses could tell of a field at best: values known stay, smooth fields are carried, rough ones aren't."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from map_ceiling import carried, ceilings

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"
SAMPLE = CONCEALED / "results/tenth16"
POINT_M = 0.02 * np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
KNOWN = np.arange(0, 36, 3)


@pytest.mark.parametrize("length_m", [0.01, 0.05, 0.2])
def test_what_is_known_stays(length_m: float) -> None:
    value = np.random.default_rng(0).standard_normal(len(KNOWN))
    assert carried(POINT_M, KNOWN, value, length_m)[KNOWN] == pytest.approx(value, abs=1e-2)


def test_a_slope_is_carried_and_what_has_no_order_is_not() -> None:
    slope, rough = POINT_M @ [1.0, 2.0], np.random.default_rng(1).standard_normal(len(POINT_M))
    elsewhere = np.setdiff1d(np.arange(len(POINT_M)), KNOWN)
    told = [carried(POINT_M, KNOWN, field[KNOWN], 0.2)[elsewhere] for field in (slope, rough)]
    assert np.corrcoef(told[0], slope[elsewhere])[0, 1] > 0.99
    assert abs(np.corrcoef(told[1], rough[elsewhere])[0, 1]) < 0.5


def test_places_pressed_come_from_the_secret() -> None:
    by_name = {one.case.name: one for one in ceilings(SAMPLE)}
    lots, hills = by_name["c006"], by_name["c011"]
    assert (lots.pressed, lots.points, hills.pressed, hills.points) == (13, 25, 22, 24)
    assert lots.best < 0.8 < hills.best


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, str(CONCEALED / "proof/map_ceiling.py"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(str(tmp_path))
    assert len(done.stderr.strip().splitlines()) == 1

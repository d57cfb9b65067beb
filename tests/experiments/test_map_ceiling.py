"""What presses could tell of a field: where they press comes from the secret, lots aren't carried, hills are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from map_ceiling import ceilings

CONCEALED = Path(__file__).parents[2] / "experiments/concealed"
SAMPLE = CONCEALED / "results/tenth16"


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

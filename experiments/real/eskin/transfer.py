"""How many touches does a new e-skin need, if the other one's network is there to start from?

    python experiments/real/eskin/transfer.py DATA [OUT]

DATA holds real/eskin_radial.h5 and real/eskin_fullCB.h5; ``transfer.json`` and its figure go to OUT, this folder by
default. Two members instead of five and a third of the epochs of ``run.py``: a comparison, not the best there is.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import location_network
import numpy as np
import torch
from figures import touches_needed
from location_network import Learned, fitted
from run import BASE, SKINS
from touches import SkinTouches, errors_mm

from ertskin.files import write_whole
from ertskin.report.figures.image import png

COUNTS = (64, 256, 1024)
DRAWS = (0,)
QUICK = replace(BASE, members=2, epochs=100)
STEPS = 400
"""Of Adam at least, however few the touches."""


def main() -> None:
    """Either skin's network on the other."""
    data = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    torch.set_num_threads(1)
    skins = {name: SkinTouches.read(data / "real" / f"eskin_{name}.h5") for name in SKINS}
    whole = {name: fitted(s.response[s.early], s.place_mm[s.early], QUICK, 0) for name, s in skins.items()}
    found = {}
    for one, other in (SKINS, SKINS[::-1]):
        found[f"{one} to {other}"] = transferred(whole[one], skins[other], whole[other])
    write_whole(out / "transfer.json", json.dumps(found, indent=1))
    write_whole(out / "transfer.png", png(touches_needed(found)))


def transferred(source: Learned, other: SkinTouches, whole: Learned) -> dict[str, dict[str, list[float]]]:
    """Mean error in mm on the held-out touches of ``other`` by number of touches and draw, afresh and from ``source``.

    With all touches: ``whole``. With none: ``source`` as it is, its inputs scaled as all touches of ``other`` ask for.
    """
    everything = other.early
    as_it_is = replace(source, **scaled(other, everything))
    curves: dict[str, dict[str, list[float]]] = {
        "afresh": {str(len(everything)): [error_mm(other, whole)]},
        "from the other": {"0": [error_mm(other, as_it_is)]},
    }
    print({way: np.round(list(points.values()), 2) for way, points in curves.items()})
    for count in COUNTS:
        rows = [np.random.default_rng(draw).choice(everything, count, replace=False) for draw in DRAWS]
        curves["afresh"][str(count)] = [judged(other, some, None) for some in rows]
        curves["from the other"][str(count)] = [judged(other, some, source) for some in rows]
        print(count, *(f"{way} {np.round(points[str(count)], 2)} mm" for way, points in curves.items()), flush=True)
    return curves


def scaled(skin: SkinTouches, rows: np.ndarray) -> dict[str, np.ndarray]:
    """What inputs and places of a skin are scaled by."""
    raw = location_network.compressed(skin.response[rows], QUICK.scale)
    return {"mean": raw.mean(axis=0), "spread": raw.std(axis=0), "centre_mm": skin.place_mm[rows].mean(axis=0)}


def judged(skin: SkinTouches, rows: np.ndarray, start: Learned | None) -> float:
    """Mean error in mm on the held-out touches, learned from ``rows``."""
    epochs = max(QUICK.epochs, -(-STEPS // (len(rows) // QUICK.batch)))
    return error_mm(skin, fitted(skin.response[rows], skin.place_mm[rows], replace(QUICK, epochs=epochs), 0, start))


def error_mm(skin: SkinTouches, learned: Learned) -> float:
    """Mean error in mm on the held-out touches."""
    return float(errors_mm(learned.places_mm(skin.response[skin.held_out]), skin.place_mm[skin.held_out]).mean())


if __name__ == "__main__":
    main()

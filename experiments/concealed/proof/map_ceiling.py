"""What presses could tell of a field of sensitivity at best: ``map_ceiling.py RESULTS...``, in this folder.

RESULTS are folders of opened samples. For every hidden field that only presses show, the true values at the sensing
points that the plan presses, carried to all others by kriging as the diagnosis does it, with the length that does it
best: nobody knows that length, nor the values so well. A press feels more than its point, so a map may do better: it is
no bound, only what values at points are worth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import seals
from judged import CORRELATION, Judged
from numpy.typing import NDArray
from opened_sample import METHOD, judged, opened
from record import skin_of
from scipy.spatial.distance import cdist
from suite import Case, suite

from ertskin.diagnosis.judge.map_probability import Places, kriged
from ertskin.diagnosis.search.smooth_fields import LENGTHS

Array = NDArray[np.float64]

FIELD = "piezo_inhomogeneity"


@dataclass(frozen=True)
class Ceiling:
    """A hidden field of a case: how many of the sensing ``points`` are ``pressed``, the correlation with the true field
    that true values there come to at ``best``, and that of the map that was ``said`` (0 without one)."""

    case: Judged
    form: str
    own: float
    pressed: int
    points: int
    best: float
    said: float


def ceilings(results: Path) -> Iterator[Ceiling]:
    """Those of an opened sample; raises ``SealError`` where its seals don't hold."""
    committed, secret = seals.read_json(results / "commitments.json"), seals.read_json(results / "opened.json.xz")
    about = committed["suite"]
    drawn = {case.name: case for case in suite(bytes.fromhex(secret["secret"]), about["families"], about["small"])}
    for case in judged(results, opened(results))[METHOD]:
        hidden = case.truth_of(FIELD)
        if hidden is not None:
            yield _ceiling(case, hidden, drawn[case.name])


def _ceiling(case: Judged, hidden: dict[str, Any], drawn: Case) -> Ceiling:
    point_m, true = np.array(case.truth["point_m"]), np.array(hidden["details"]["map"])
    place_m = np.concatenate([press.position_m for press in skin_of(drawn).plan.presses])
    pressed = np.unique(cdist(place_m, point_m).argmin(axis=1))
    side_m = float(np.ptp(point_m, axis=0).max())
    places = Places(point_m[pressed], true[pressed], np.zeros(len(pressed)))
    spread = float(places.value.std())
    lengths = LENGTHS if spread > 0 else ()
    fields = (kriged(point_m, places, length * side_m, spread).mean for length in lengths)
    best = max((float(np.corrcoef(field, true)[0, 1]) for field in fields), default=0.0)
    said = max((case.correlation(one) for one in case.claims if one["name"] == FIELD), default=0.0)
    return Ceiling(case, hidden["form"], hidden["own"], len(pressed), len(point_m), best, said)


def _line(sample: str, one: Ceiling) -> str:
    what = f"{one.case.kind}, {one.form} {one.own:.3g}"
    where = f"{one.case.truth['presses']}, {one.pressed} of {one.points}"
    right = "yes" if one.case.all_found else ""
    return f"| {one.case.name} of `{sample}` | {what} | {where} | {one.best:.2f} | {one.said:.2f} | {right} |"


def _summary(kind: str, found: list[Ceiling]) -> str:
    within, beyond = ([one for one in found if (one.best >= CORRELATION) is reached] for reached in (True, False))
    right, lucky = (sum(one.case.all_found for one in some) for some in (within, beyond))
    said = f"{len(within)} reach {CORRELATION} at best, of which {right} are right"
    return f"{kind}: of {len(found)} fields {said}, {len(beyond)} don't, of which {lucky} are."


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, nargs="+", help="folders of opened samples")
    options = parser.parse_args()
    try:
        found = [(results.name, one) for results in options.results for one in ceilings(results)]
    except seals.SealError as error:
        print(error, file=sys.stderr)
        return 2
    print("| recording | kind, form, own ratio | presses, points pressed | at best | said | all names right |")
    print("| --- | --- | --- | --- | --- | --- |")
    for sample, one in found:
        print(_line(sample, one))
    for kind in ("single", "compound"):
        print(f"\n{_summary(kind, [one for _, one in found if one.case.kind == kind])}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

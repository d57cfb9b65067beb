"""Rivals of the diagnosis: the same simulator, calibration and library of effects, another way to say what is missing.

``python experiments/concealed/rivals.py METHOD recording.h5 OUT/diagnosis.json``. As a method of the proof:
``diagnose.py OUT --method "omp=python experiments/concealed/rivals.py omp {recording} {out}/diagnosis.json"``.
Effects of the foam in the load cell's forces, contacts that wander at rest and a converter's declared limit belong to
what all share; of those the discrepancy says nothing, for it has no names. Each chooses once, from the presses that
aren't held out; where the diagnosis would choose again from all presses, what it chose is fitted to them.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from distortion_tests import by_distortion_tests  # noqa: E402
from matching_pursuit import by_matching_pursuit  # noqa: E402
from nameless_discrepancy import by_nothing, nameless  # noqa: E402
from selectors_of_effects import by_aic, by_lisdd  # noqa: E402

from ertskin.diagnosis.any_recording import diagnose_any  # noqa: E402
from ertskin.diagnosis.contract.claims import Diagnosis  # noqa: E402
from ertskin.diagnosis.fit.full_solution_check import Problem  # noqa: E402
from ertskin.diagnosis.fit.terms import Term  # noqa: E402
from ertskin.diagnosis.judge.result import Findings  # noqa: E402
from ertskin.diagnosis.linear.calibration_vector import Calibration  # noqa: E402
from ertskin.diagnosis.output.diagnosis_file import write_diagnosis  # noqa: E402
from ertskin.diagnosis.search.chosen import Selection  # noqa: E402
from ertskin.diagnosis.search.selection import Report  # noqa: E402
from ertskin.diagnosis.skin import Selector, Shown  # noqa: E402
from ertskin.hardware.recording import read_recording  # noqa: E402


@dataclass(frozen=True)
class Method:
    """How a rival chooses effects, and what it says once they are judged on the presses held out."""

    chooses: Selector
    says: Callable[[Findings], Diagnosis] = lambda findings: findings.diagnosis


METHODS = {
    "aic": Method(by_aic),
    "lisdd": Method(by_lisdd),
    "distortions": Method(by_distortion_tests),
    "omp": Method(by_matching_pursuit),
    "discrepancy": Method(by_nothing, nameless),
}


class Once:
    """A selector that chooses at its first call. At any further one, of other frames, what it chose is fitted to these
    about the fit it was chosen in, beside the terms ``fixed`` by now: fields, and what of the rest is among ``begun``.
    """

    def __init__(self, chooses: Selector) -> None:
        self.chooses = chooses
        self.chosen: Selection | None = None

    def __call__(
        self,
        build: Problem,
        fixed: Sequence[Term],
        begun: Shown,
        start: Calibration,
        partitions: Sequence[Sequence[int]],
        report: Report,
    ) -> Selection:
        if self.chosen is None:
            self.chosen = self.chooses(build, fixed, begun, start, partitions, report)
            return self.chosen
        names = {term.name for term, _ in begun}
        kept = [one for one in self.chosen.chosen if one.term.modes is not None or one.term.name in names]
        found = self.chosen.after
        problem = build(found)
        after = problem.solve([*fixed, *(one.term for one in kept)], found.calibration, leftover=found.leftover)
        chosen = tuple(replace(one, term=term) for one, term in zip(kept, after.terms[len(fixed) :], strict=True))
        return replace(self.chosen, after=after, chosen=chosen, problem=problem)


def diagnosis_by(name: str, path: Path) -> Diagnosis:
    """What a rival says of a recording."""
    method = METHODS[name]
    recording, once = read_recording(path), Once(method.chooses)
    return method.says(diagnose_any(recording, path.name, lambda share, text: None, selector=once))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("method", choices=METHODS)
    parser.add_argument("recording", type=Path)
    parser.add_argument("diagnosis", type=Path, help="OUT/diagnosis.json")
    options = parser.parse_args()
    if options.diagnosis.name != "diagnosis.json":
        parser.error(f"{options.diagnosis} isn't called diagnosis.json, as every diagnosis is")
    found = diagnosis_by(options.method, options.recording)
    write_diagnosis(options.diagnosis.parent, found)
    names = ", ".join(f"{claim.effect.name} {claim.confidence:.2f}" for claim in found.claims) or "no name"
    held = found.held_out
    print(f"{options.recording.name}: {found.verdict}, {names}; held out {held.ratio_before} -> {held.ratio_after}")
    print(f"{time.process_time():.0f} s of CPU")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""How far the sheet seems not to feel a foam's force that it feels: ``python …/proof/felt_share.py RESULTS...``.

RESULTS are folders of opened samples. Foam passes on what force it has, so ``carried`` of every nonlinear foam that is
hidden and named at 0.5 or more is nought but for its form: the rms over those known well enough, that of what they were
known to, and what is left, which `ertskin.diagnosis.force.claims.FELT_ERROR` is.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable

import numpy as np
from judged import Judged
from opened_sample import asked_for

from ertskin.diagnosis.contract.claims import QUANTILE

NAME, KEY = "nonlinear_foam", "carried"
KNOWN = 0.3
"""Standard error from which on a share says nothing."""


def felt_shares(cases: Iterable[Judged]) -> list[tuple[float, float]]:
    """Values and standard errors; of an interval that a bound cuts off the longer side tells the error."""
    found = []
    for case in cases:
        for claim in case.likely:
            if claim["name"] == NAME and case.is_right(claim) and KEY in claim["parameters"]:
                said = claim["parameters"][KEY]
                half = max(said["high"] - said["value"], said["value"] - said["low"])
                found.append((said["value"], half / QUANTILE))
    return [(value, error) for value, error in found if error < KNOWN]


def main() -> int:
    found = felt_shares(asked_for(__doc__))
    if not found:
        print("no foam of which that is known")
        return 0
    value, error = np.transpose(found)
    off, known = (float(np.sqrt(np.mean(np.square(one)))) for one in (value, error))
    left = float(np.sqrt(max(off**2 - known**2, 0.0)))
    print(f"{len(value)} foams: off by {off:.3f}, known to {known:.3f}, left {left:.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

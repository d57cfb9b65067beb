"""Compounds by the proof's generator, each of a kind that a greedy search fails on: ``compounds.py OUT [NAME ...]``.

Writes OUT/recordings/NAME.h5 and the truths under OUT/sealed. No proof: whoever mended the search has seen these.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
sys.path.insert(0, str(Path(__file__).parent / "proof"))

from record import record  # noqa: E402
from suite import Case, Hidden  # noqa: E402

SECRET = b"compounds"


def compound(name: str, seed: int, hidden: dict[str, tuple[str, float]], presses: int = 12, **more: str) -> Case:
    """A case on neoprene with 16 electrodes, all of them read: by effect its form and its own ratio."""
    effects = tuple(Hidden(effect, *form) for effect, form in hidden.items())
    return Case(name, "compound", seed, "square16", "neoprene", "full", presses, effects, **more)  # type: ignore[arg-type]


SKEW_AND_DRIFT = {"scan_skew": ("first_order_lag", 8.0), "temperature_drift": ("newton_with_gradient", 2.0)}
CASES = (
    compound(
        "d02",
        202,
        {"piezo_hysteresis": ("preisach_adhesion", 2.0), "piezo_creep": ("kohlrausch", 2.0)},
        specimen="none",
    ),
    compound("d03", 203, {"crosstalk": ("rc_per_injection", 2.0)}),
    compound("d04", 204, {"crosstalk": ("rc_per_injection", 2.0), "sheet_anisotropy": ("skew_weave", 2.0)}),
    compound("d06", 113, {"piezo_inhomogeneity": ("hills", 1.7), "piezo_hysteresis": ("preisach_adhesion", 1.5)}, 18),
    compound(
        "d12", 212, {"piezo_creep": ("fractional_kelvin", 2.0), "temperature_drift": ("newton_with_gradient", 2.0)}
    ),
    compound("d13", 115, {"piezo_inhomogeneity": ("hills", 4.0), **SKEW_AND_DRIFT}),
    compound("d14", 115, {"piezo_inhomogeneity": ("patch_lots", 4.0), **SKEW_AND_DRIFT}),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder for recordings and truths")
    parser.add_argument("names", nargs="*", help="cases to record, all without it")
    options = parser.parse_args()
    for case in CASES:
        if not options.names or case.name in options.names:
            print(record(case, options.out, SECRET), flush=True)


if __name__ == "__main__":
    main()

"""Own ratios as a sample's truths were sealed with, beside those that the ruler measures now.

    python experiments/concealed/proof/own_ratios.py RESULTS... [--name scan_skew]

RESULTS are folders of opened samples. The ruler of the first seven knew presses of two depths alone (development.md).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import seals  # noqa: E402
from generator.strength import Ratio, Ruler  # noqa: E402
from record import made, skin_of  # noqa: E402
from suite import suite  # noqa: E402


def measured(results: Path, name: str) -> Iterator[tuple[str, str, Ratio, Ratio]]:
    """(case, form, ratio as sealed, ratio now) of every effect of this name in an opened sample."""
    opened = seals.read_json(results / "opened.json.xz")
    chosen = seals.read_json(results / "commitments.json")["suite"]["families"]
    for case in suite(bytes.fromhex(opened["secret"]), chosen):
        truth = opened["cases"].get(case.name, {"truth": {"effects": []}})["truth"]
        for hidden, one in zip(case.hidden, truth["effects"], strict=False):
            if one["name"] == name:
                skin = skin_of(case)
                sealed = Ratio(one["reciprocal"], one["rest"], one["force"])
                yield case.name, one["form"], sealed, Ruler(skin).ratio([made(hidden, skin, one["size"], case.seed)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, nargs="+", help="folders of opened samples")
    parser.add_argument("--name", default="scan_skew", help="of the effect")
    options = parser.parse_args()
    print("| recording | form | own ratio as sealed (readings, force) | now (readings, force) |")
    print("| --- | --- | --- | --- |")
    for results in options.results:
        for case, form, sealed, now in measured(results, options.name):
            pairs = (f"{one.own:.2f} ({max(one.reciprocal, one.rest):.2f}, {one.force:.2f})" for one in (sealed, now))
            print(f"| {case} of `{results.name}` | {form} | {' | '.join(pairs)} |", flush=True)


if __name__ == "__main__":
    main()

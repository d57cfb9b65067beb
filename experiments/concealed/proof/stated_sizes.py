"""How large effects are said to be over how large they are: ``python …/proof/stated_sizes.py RESULTS...``.

RESULTS are folders of opened samples. Of every effect rightly named at 0.5 or more the quantity stated over the true
one, by hidden form. A form whose median is far from one, however well it fits, acts otherwise than the model has it.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from judged import Judged
from opened_sample import asked_for

PART = (25, 50, 75)
"""Percentiles that are shown."""


class Stated(NamedTuple):
    """A quantity stated over the true one, and whether its interval holds that."""

    over_true: float
    holds: bool


def stated_sizes(cases: Iterable[Judged]) -> dict[tuple[str, str, str], list[Stated]]:
    """By name, hidden form and quantity; quantities that are truly nought are left out."""
    found: dict[tuple[str, str, str], list[Stated]] = defaultdict(list)
    for case in cases:
        for hidden, quantity, true, said in case.quantities():
            if said is not None and true:
                one = Stated(said["value"] / true, said["low"] <= true <= said["high"])
                found[hidden["name"], hidden["form"], quantity].append(one)
    return dict(sorted(found.items()))


def main() -> int:
    print("| name | form | quantity | claims | stated over true: quartiles, median between | intervals that hold |")
    print("| --- | --- | --- | --- | --- | --- |")
    for (name, form, quantity), stated in stated_sizes(asked_for(__doc__)).items():
        low, median, high = np.percentile([one.over_true for one in stated], PART)
        held = sum(one.holds for one in stated)
        row = f"{len(stated)} | {low:.2f}, **{median:.2f}**, {high:.2f} | {held} of {len(stated)}"
        print(f"| `{name}` | `{form}` | `{quantity}` | {row} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Draw a suite's truths again and hold them to published seals, without recording anything.

``python experiments/concealed/redrawn.py SEALS.json --seed 6 --plan revisit [--only c005] [--nulls]``: a null takes
milliseconds, a skin with effects ten seconds. Exit status 1 where a seal is not met. Truths are not rounded before they
are sealed: a processor whose logarithms end in another digit does not meet them.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from generate import chosen, draw

from ertskin.hardware.virtual.bench.sealing import commitment, to_seal

SINCE = ("jitter_share", "landing_m")
"""Kinds of noise, none here, that truths list since 7658d15: seals before it are of texts without them."""


def meets(nonce: str, text: str, published: str) -> bool:
    """Whether the sealed text, or what it was before ``SINCE``, has the published checksum."""
    older = json.loads(text)
    added = [older["truth"]["noise"].pop(name) for name in SINCE]
    texts = [text] if any(added) else [text, json.dumps(older, sort_keys=True)]
    return published in [commitment(nonce, one) for one in texts]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seals", type=Path, help="the published commitments, a JSON object by case")
    parser.add_argument("--seed", type=int, required=True, help="the suite's seed")
    parser.add_argument("--plan", help="the plan it was recorded on, the suite's own without it")
    parser.add_argument("--only", nargs="*", help="names of cases, all without it")
    parser.add_argument("--nulls", action="store_true", help="only skins that hide nothing")
    parser.set_defaults(small=False)
    options = parser.parse_args()
    published = json.loads(options.seals.read_text())
    cases = [case for case in chosen(options) if case.name in published and not (options.nulls and case.ratios)]
    other = [case.name for case in cases if not meets(*to_seal(*draw(case)), published[case.name])]
    print(f"{len(cases) - len(other)} of {len(cases)} seals met" + "".join(f"; not {name}" for name in other))
    return 1 if other else 0


if __name__ == "__main__":
    sys.exit(main())

"""Put a suite's evidence into the repository: ``python experiments/concealed/proof/publish.py OUT SEED [--commit]``.

With ``--commit``, before any diagnosis: the commitments alone. Without it, after the last diagnosis: the secret, every
truth and nonce, every diagnosis.json, compressed, and what the model that diagnosed leaves of every form
(isolated_laws.json); sealed families that were opened are marked as spent. A change of the commitments in between is
refused.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import seals
from suite import SPLIT

RESULTS = Path(__file__).parents[1] / "results"
LAWS = Path(__file__).with_name("isolated_laws.json")


def commit(out: Path, results: Path) -> None:
    """Publish what binds; raises ``SealError`` where something is published already."""
    if (results / "commitments.json").exists():
        raise seals.SealError(f"{results / 'commitments.json'}: published already; a seed is committed once")
    seals.write_json(results / "commitments.json", seals.read_json(out / "commitments.json"))


def reveal(out: Path, results: Path) -> None:
    """Publish what opens; raises ``SealError`` where it isn't what was committed."""
    committed = seals.read_json(results / "commitments.json")
    cases = {name: seals.read_json(out / "sealed" / f"{name}.json") for name in committed["cases"]}
    for name, one in cases.items():
        seals.check(name, one["truth"], one["nonce"], committed["cases"][name]["truth"])
    secret = (out / "secret.txt").read_text().strip()
    seals.write_json(results / "opened.json.xz", {"secret": secret, "cases": cases})
    said: dict[str, Any] = {}
    for folder in sorted(path for path in (out / "diagnoses").glob("*") if path.is_dir()):
        found = {path.parent.name: json.loads(path.read_text()) for path in sorted(folder.glob("*/diagnosis.json"))}
        said[folder.name] = {name: one for name, one in found.items() if name in cases}
    seals.write_json(results / "diagnoses.json.xz", said)
    seals.write_json(results / LAWS.name, seals.read_json(LAWS))
    _spend(results.name, [one["truth"] for one in cases.values()])


def _spend(seed: str, truths: list[dict[str, Any]]) -> None:
    """Mark sealed families that this seed has opened."""
    split = json.loads(SPLIT.read_text())
    used = sorted({e["name"] for truth in truths for e in truth["effects"]} & set(split["sealed"]))
    known = {name for names in split["spent"].values() for name in names}
    if set(used) - known:
        split["spent"][seed] = sorted(set(used) - known)
        seals.write_json(SPLIT, split)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the suite")
    parser.add_argument("seed", help="name of the results' folder, such as seed7")
    parser.add_argument("--commit", action="store_true", help="publish the commitments, before anything is diagnosed")
    options = parser.parse_args()
    try:
        (commit if options.commit else reveal)(options.out, RESULTS / options.seed)
    except seals.SealError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{RESULTS / options.seed}: {'commitments published' if options.commit else 'opened'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

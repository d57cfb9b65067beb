"""Put a suite's evidence into the repository: ``python experiments/concealed/proof/publish.py OUT SEED [--commit]``.

With ``--commit``, before any diagnosis: the commitments alone. Without it, after the last diagnosis: the secret, every
truth and nonce, every diagnosis.json, compressed, and what the model that diagnosed leaves of every form
(isolated_laws.json); sealed families that were opened are marked as spent. A change of the commitments in between is
refused. A suite too long for one sitting is recorded, committed, diagnosed and published in parts of one secret, which
``--more`` keeps back until the last (what it opens lies in opened_so_far.json.xz, which nothing scores): OUT need hold
no more than the part at hand.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import seals
from diagnose import STOPPED
from suite import SPLIT

RESULTS = Path(__file__).parents[1] / "results"
LAWS = Path(__file__).with_name("isolated_laws.json")


def commit(out: Path, results: Path) -> None:
    """Publish what binds, added to what does already; raises ``SealError`` where that is of another suite, or holds
    all of it, or something else for one of its cases."""
    path, new = results / "commitments.json", seals.read_json(out / "commitments.json")
    old = seals.read_json(path) if path.exists() else {**new, "cases": {}}
    if any(old[key] != new[key] for key in ("secret", "suite")):
        raise seals.SealError(f"{path}: of another secret or suite; publish this one under another name")
    changed = [name for name, one in new["cases"].items() if old["cases"].get(name, one) != one]
    if changed:
        raise seals.SealError(f"{path}: {', '.join(changed)} published already, as something else")
    if not new["cases"].keys() - old["cases"].keys():
        raise seals.SealError(f"{path}: published already; a case is committed once")
    seals.write_json(path, {**new, "cases": {**old["cases"], **new["cases"]}})


def reveal(out: Path, results: Path, more: bool = False) -> None:
    """Publish what opens, added to what does already; raises ``SealError`` where it isn't what was committed, or not
    all of it. If ``more`` is to come that is the part diagnosed so far, without the secret."""
    committed = seals.read_json(results / "commitments.json")
    so_far = results / "opened_so_far.json.xz"
    cases = _earlier(so_far)
    for name in committed["cases"]:
        path = out / "sealed" / f"{name}.json"
        if path.exists() and (_answered(out, name) or not more):
            cases[name] = seals.read_json(path)
    missing = [name for name in committed["cases"] if name not in cases]
    if missing and not more:
        raise seals.SealError(
            f"{out}: holds no truth of {', '.join(missing)}, which are committed; --more if they follow"
        )
    for name, one in cases.items():
        seals.check(name, one["truth"], one["nonce"], committed["cases"][name]["truth"])
    if more:
        seals.write_json(so_far, cases)
    else:
        secret = (out / "secret.txt").read_text().strip()
        seals.write_json(results / "opened.json.xz", {"secret": secret, "cases": cases})
    said: dict[str, Any] = _earlier(results / "diagnoses.json.xz")
    for folder in sorted(path for path in (out / "diagnoses").glob("*") if path.is_dir()):
        found = {path.parent.name: json.loads(path.read_text()) for path in sorted(folder.glob("*/diagnosis.json"))}
        mine = {name: one for name, one in found.items() if name in cases}
        said[folder.name] = {**said.get(folder.name, {}), **mine}
    seals.write_json(results / "diagnoses.json.xz", said)
    seals.write_json(results / LAWS.name, seals.read_json(LAWS))
    if not more:
        _spend(results.name, [one["truth"] for one in cases.values()])
        so_far.unlink(missing_ok=True)


def _answered(out: Path, name: str) -> bool:
    """Whether a case was diagnosed, or a diagnosis of it took too long."""
    return any(any(out.glob(f"diagnoses/*/{name}/{made}")) for made in ("diagnosis.json", STOPPED))


def _earlier(path: Path) -> dict[str, Any]:
    """What earlier parts have published; nothing before the first."""
    return dict(seals.read_json(path)) if path.exists() else {}


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
    parser.add_argument("--more", action="store_true", help="other parts of the suite follow: keep its secret back")
    options = parser.parse_args()
    try:
        if options.commit:
            commit(options.out, RESULTS / options.seed)
        else:
            reveal(options.out, RESULTS / options.seed, options.more)
    except seals.SealError as error:
        print(error, file=sys.stderr)
        return 2
    done = "commitments published" if options.commit else "a part opened" if options.more else "opened"
    print(f"{RESULTS / options.seed}: {done}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

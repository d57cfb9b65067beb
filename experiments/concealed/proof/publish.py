"""Put a suite's evidence into the repository: ``python experiments/concealed/proof/publish.py OUT SEED [--commit]``.

With ``--commit``, before any diagnosis: the commitments alone. Without it, after the last diagnosis: the secret, every
truth and nonce, every diagnosis.json, compressed, and what the model that diagnosed leaves of every form
(isolated_laws.json, the first time); sealed families that were opened are marked as spent. A change of what is
committed, or of an answer whose truth is open, is refused. A suite too long for one sitting is recorded, committed,
diagnosed and published in parts of one secret, which ``--more`` keeps back until the last (what it opens lies in
opened_so_far.json.xz, which nothing scores): OUT need hold no more than the part at hand, and what of earlier ones has
no answer. ``--sample`` opens a suite of which only some cases were recorded, and no others will be.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import seals
from diagnose import STOPPED
from opened_sample import METHOD
from suite import SPLIT, suite

RESULTS = Path(__file__).parents[1] / "results"
LAWS = Path(__file__).with_name("isolated_laws.json")
OPENED, SO_FAR = "opened.json.xz", "opened_so_far.json.xz"


def commit(out: Path, results: Path) -> None:
    """Publish what binds, added to what does already; raises ``SealError`` where that is of another suite, opened, or
    holds all of it or something else for one of its cases, and where a case has been diagnosed."""
    path, new = results / "commitments.json", seals.read_json(out / "commitments.json")
    if (results / OPENED).exists():
        raise seals.SealError(f"{results / OPENED}: open already; nothing more can be committed to")
    old = seals.read_json(path) if path.exists() else {**new, "cases": {}}
    if any(old[key] != new[key] for key in ("secret", "suite")):
        raise seals.SealError(f"{path}: of another secret or suite; publish this one under another name")
    changed = [name for name, one in new["cases"].items() if old["cases"].get(name, one) != one]
    if changed:
        raise seals.SealError(f"{path}: {', '.join(changed)} published already, as something else")
    added = [name for name in new["cases"] if name not in old["cases"]]
    if not added:
        raise seals.SealError(f"{path}: published already; a case is committed once")
    diagnosed = [name for name in added if _answered(out, name, "*")]
    if diagnosed:
        raise seals.SealError(f"{out}: {', '.join(diagnosed)} diagnosed before being committed to")
    seals.write_json(path, {**new, "cases": {**old["cases"], **new["cases"]}})


def reveal(out: Path, results: Path, more: bool = False, sample: bool = False) -> list[str]:
    """Publish what opens, added to what does already; names of cases that are opened without an answer.

    If ``more`` is to come that is the part answered so far, without the secret. Raises ``SealError`` where it isn't
    what was committed, or changes an answer, or isn't all of the suite, nor a ``sample`` of it, and no more is to come.
    """
    committed = seals.read_json(results / "commitments.json")
    if more and (results / OPENED).exists():
        raise seals.SealError(f"{results / OPENED}: open already; --more is for parts before the last")
    before = _earlier(results / SO_FAR) or _earlier(results / OPENED).get("cases", {})
    cases = dict(before)
    for name in committed["cases"]:
        path = out / "sealed" / f"{name}.json"
        if path.exists() and (_answered(out, name) or not more):
            cases[name] = seals.read_json(path)
    for name, one in cases.items():
        seals.check(name, one["truth"], one["nonce"], committed["cases"][name]["truth"])
    secret = None if more else _secret_of_all(out, committed, cases, sample)
    said = _answers(out, results, cases, before)
    seals.write_json(results / "diagnoses.json.xz", said)
    if not (results / LAWS.name).exists():
        seals.write_json(results / LAWS.name, seals.read_json(LAWS))
    # Truths last: whatever ends this in between leaves no case open whose answer isn't there.
    if secret is None:
        seals.write_json(results / SO_FAR, cases)
    else:
        seals.write_json(results / OPENED, {"secret": secret, "cases": cases})
        _spend(results.name, [one["truth"] for one in cases.values()])
        (results / SO_FAR).unlink(missing_ok=True)
    return [name for name in cases if name not in said.get(METHOD, {})]


def _secret_of_all(out: Path, committed: dict[str, Any], cases: dict[str, Any], sample: bool) -> str:
    """The secret, where all that is committed opens and that is all of the suite, or a ``sample`` of it."""
    secret = (out / "secret.txt").read_text().strip()
    if hashlib.sha256(bytes.fromhex(secret)).hexdigest() != committed["secret"]:
        raise seals.SealError(f"{out / 'secret.txt'}: not the secret committed to")
    missing = [name for name in committed["cases"] if name not in cases]
    if missing:
        raise seals.SealError(f"{out}: no truth of {', '.join(missing)}, which are committed; --more if they follow")
    about = committed["suite"]
    drawn = [case.name for case in suite(bytes.fromhex(secret), about["families"], about["small"])]
    left = len(drawn) - len(committed["cases"])
    if left and not sample:
        raise seals.SealError(f"{left} of the suite's {len(drawn)} cases aren't committed: --more or --sample")
    return secret


def _answers(out: Path, results: Path, cases: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """Every method's diagnoses, added to those published; raises ``SealError`` where one of a case that was open
    ``before`` isn't as it was, unless the method is new."""
    said: dict[str, Any] = _earlier(results / "diagnoses.json.xz")
    for folder in sorted(path for path in (out / "diagnoses").glob("*") if path.is_dir()):
        found = {path.parent.name: json.loads(path.read_text()) for path in sorted(folder.glob("*/diagnosis.json"))}
        mine, known = {name: one for name, one in found.items() if name in cases}, said.get(folder.name)
        changed = [
            name for name, one in mine.items() if known is not None and name in before and known.get(name) != one
        ]
        if changed:
            raise seals.SealError(f"{folder}: {', '.join(changed)} answered otherwise than when their truth was opened")
        said[folder.name] = {**(known or {}), **mine}
    return said


def _answered(out: Path, name: str, method: str = METHOD) -> bool:
    """Whether a case was diagnosed by a method, or a diagnosis of it took too long."""
    return any(any(out.glob(f"diagnoses/{method}/{name}/{made}")) for made in ("diagnosis.json", STOPPED))


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
    parser.add_argument("--sample", action="store_true", help="what is committed is all that is recorded of the suite")
    options = parser.parse_args()
    results, silent = RESULTS / options.seed, list[str]()
    try:
        if options.commit:
            commit(options.out, results)
        else:
            silent = reveal(options.out, results, options.more, options.sample)
    except seals.SealError as error:
        print(error, file=sys.stderr)
        return 2
    done = "commitments published" if options.commit else "a part opened" if options.more else "opened"
    print(f"{results}: {done}" + (f"; without an answer: {', '.join(silent)}" if silent else ""))
    return 0


if __name__ == "__main__":
    sys.exit(main())

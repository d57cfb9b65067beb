"""An opened sample as it lies in the repository: every seal checked, every method's diagnoses beside the truths."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from typing import Any

import seals
from judged import DiagnosisError, Judged, checked
from suite import suite

METHOD = "ertskin"


def opened(results: Path, recordings: Path | None = None) -> dict[str, dict[str, Any]]:
    """Truths by case, all seals checked; raises ``SealError`` for the first that doesn't hold."""
    committed = seals.read_json(results / "commitments.json")
    revealed = seals.read_json(results / "opened.json.xz")
    secret = bytes.fromhex(revealed["secret"])
    if hashlib.sha256(secret).hexdigest() != committed["secret"]:
        raise seals.SealError(f"{results}: the secret is not the one committed")
    drawn = {case.name: case for case in suite(secret, committed["suite"]["families"], committed["suite"]["small"])}
    truths = {}
    for name, commitment in committed["cases"].items():
        one = revealed["cases"].get(name)
        if one is None:
            raise seals.SealError(f"{name}: committed but not opened")
        if one["nonce"] != seals.nonce(secret, name):
            raise seals.SealError(f"{name}: its nonce doesn't come from the secret")
        seals.check(name, one["truth"], one["nonce"], commitment["truth"])
        if any(one["truth"][key] != getattr(drawn[name], key) for key in ("kind", "seed", "shape", "scan", "presses")):
            raise seals.SealError(f"{name}: not the case that the secret draws")
        if recordings is not None and seals.file_hash(recordings / f"{name}.h5") != commitment["recording"]:
            raise seals.SealError(
                f"{name}: the recording's bytes are not those committed (if recorded again: by the same kernels of BLAS"
                " and numpy? proof/README.md says which)"
            )
        truths[name] = one["truth"]
    return truths


def judged(results: Path, truths: dict[str, dict[str, Any]]) -> dict[str, list[Judged]]:
    """Every method's diagnoses beside the truths; a case without a diagnosis names nothing."""
    said = seals.read_json(results / "diagnoses.json.xz")
    return {
        method: [Judged(name, truth, checked(f"{method}/{name}", by_case.get(name))) for name, truth in truths.items()]
        for method, by_case in said.items()
    }


def asked_for(description: str | None) -> list[Judged]:
    """The diagnosis's cases of the samples that the command line names; what is wrong with one ends it in a line."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("results", type=Path, nargs="+", help="folders of opened samples")
    options = parser.parse_args()
    try:
        return [case for results in options.results for case in judged(results, opened(results))[METHOD]]
    except (seals.SealError, DiagnosisError) as error:
        parser.exit(2, f"{error}\n")

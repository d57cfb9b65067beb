"""Truths sealed before anyone looks: a commitment beside the recording, the truth elsewhere, opened by the score.

The commitment is SHA-256 of nonce and truth. The nonce keeps those who don't know the suite's seed from trying truths
against it; both lie in the truth's file, so that whoever opens it can check that nothing was changed after the
recording was handed over.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ertskin.hardware.virtual.bench.truth import Truth


class SealError(ValueError):
    """A truth that is missing, or is not the one committed to: one line naming the file."""


def to_seal(truth: Truth, about: Mapping[str, Any] | None = None) -> tuple[str, str]:
    """Nonce and text that a truth is sealed as. The nonce is drawn from the truth's seed."""
    text = json.dumps({"truth": json.loads(truth.to_json()), "about": dict(about or {})}, sort_keys=True)
    return truth.rng("seal").bytes(16).hex(), text


def commitment(nonce: str, truth: str) -> str:
    """The checksum that is published: SHA-256 of nonce and truth."""
    return hashlib.sha256(f"{nonce}\n{truth}".encode()).hexdigest()


def _write(path: Path, content: dict[str, str]) -> None:
    aside = path.with_name(path.name + ".part")
    aside.write_text(json.dumps(content, indent=1, sort_keys=True) + "\n")
    os.replace(aside, path)


def _names(recording: Path, folder: Path) -> tuple[Path, Path]:
    return recording.with_suffix(".seal.json"), folder / f"{recording.stem}.truth.json"


def seal(recording: Path, truth: Truth, folder: Path, about: Mapping[str, Any] | None = None) -> str:
    """Put the truth of a recording, and anything ``about`` it, into ``folder``, the commitment beside the recording.

    Returns the commitment. The same suite written again has the same seals (``to_seal``).
    """
    folder.mkdir(parents=True, exist_ok=True)
    seal_file, hidden = _names(recording, folder)
    nonce, text = to_seal(truth, about)
    checksum = commitment(nonce, text)
    _write(hidden, {"nonce": nonce, "sealed": text})
    _write(seal_file, {"recording": recording.name, "sha256": checksum})
    return checksum


def committed(recording: Path) -> str:
    """The checksum beside a recording that its truth was committed to by; raises ``SealError`` where there is none."""
    seal_file = recording.with_suffix(".seal.json")
    try:
        return str(json.loads(seal_file.read_text())["sha256"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SealError(f"{recording}: no seal to open ({error})") from error


def unseal(recording: Path, folder: Path) -> tuple[Truth, dict[str, Any]]:
    """The truth of a recording and what was said about it.

    Raises ``SealError`` if there is none or it isn't the one committed to.
    """
    seal_file, hidden = _names(recording, folder)
    checksum = committed(recording)
    try:
        held = json.loads(hidden.read_text())
        nonce, text = held["nonce"], held["sealed"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SealError(f"{recording}: no seal to open ({error})") from error
    if commitment(nonce, text) != checksum:
        raise SealError(f"{hidden}: this is not the truth that was committed in {seal_file.name}")
    opened = json.loads(text)
    return Truth.from_json(json.dumps(opened["truth"])), opened["about"]

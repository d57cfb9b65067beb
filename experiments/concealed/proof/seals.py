"""Commit, then reveal: a truth's hash before any diagnosis, the truth and its nonce after the score.

A truth is rounded before it is hashed, and nonces come from one secret by HMAC-SHA-256: whoever is given the secret
regenerates every case, truth, nonce and seal on any machine. Without it neither can be guessed, for the suite itself is
drawn from it.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import lzma
import os
from pathlib import Path
from typing import Any

DIGITS = 6


class SealError(ValueError):
    """A truth or a recording that isn't the one committed: one line naming it."""


def rounded(value: Any) -> Any:
    """Floats to ``DIGITS`` significant digits, whatever holds them; whole floats become integers."""
    if isinstance(value, dict):
        return {str(key): rounded(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(one) for one in value]
    if isinstance(value, bool) or value is None or isinstance(value, int | str):
        return value
    short = float(f"{float(value):.{DIGITS}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def canonical(truth: dict[str, Any]) -> bytes:
    """The bytes that are hashed."""
    return json.dumps(rounded(truth), sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def nonce(secret: bytes, name: str) -> str:
    """64 hexadecimal digits for one case."""
    return hmac.new(secret, name.encode(), hashlib.sha256).hexdigest()


def seal(truth: dict[str, Any], nonce_hex: str) -> str:
    """SHA-256 of nonce and truth."""
    return hashlib.sha256(bytes.fromhex(nonce_hex) + canonical(truth)).hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check(name: str, truth: dict[str, Any], nonce_hex: str, committed: str) -> None:
    """Raises ``SealError`` unless this truth was committed."""
    if seal(truth, nonce_hex) != committed:
        raise SealError(f"{name}: the truth is not the one committed; don't trust the score of this folder")


def write_json(path: Path, content: Any) -> None:
    """Aside, then renamed; ``.xz`` names are compressed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    raw = (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    aside.write_bytes(lzma.compress(raw, preset=9) if path.suffix == ".xz" else raw)
    os.replace(aside, path)


def read_json(path: Path) -> Any:
    """What ``write_json`` wrote; raises ``SealError`` where there is none, or something else."""
    if not path.exists():
        raise SealError(f"{path}: found no such file, expected one that publish.py or record.py wrote")
    raw = path.read_bytes()
    try:
        return json.loads(lzma.decompress(raw) if path.suffix == ".xz" else raw)
    except (lzma.LZMAError, ValueError) as error:
        raise SealError(f"{path}: not what publish.py or record.py wrote ({error})") from error

"""Shards on disk: written aside and renamed, listed with checksums, computed only where missing."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError

Arrays = dict[str, NDArray[Any]]
MANIFEST = "manifest.json"
FORMAT = "ertskin-shards"
VERSION = 1


class ShardStore:
    """A folder of numbered ``.npz`` shards that belong to one request.

    ``request`` is plain JSON data that says all the content depends on; a folder that holds another request's shards
    raises ``UserError``. ``write`` may be called by several processes for different numbers. ``seal`` lists every
    shard's SHA-256 in the manifest.
    """

    def __init__(self, folder: Path, request: dict[str, Any], shards: int) -> None:
        self.folder, self.request, self.shards = folder, request, shards
        folder.mkdir(parents=True, exist_ok=True)
        self._claim()

    def missing(self) -> list[int]:
        """Numbers of the shards not yet there, or there with another content than the manifest says."""
        listed = self._manifest().get("sha256", {})
        return [k for k in range(self.shards) if not self._sound(k, listed.get(str(k)))]

    def write(self, number: int, arrays: Arrays) -> None:
        """Write one shard so that a kill leaves either all of it or nothing."""
        aside = self._path(number).with_suffix(f".{os.getpid()}.tmp")
        with aside.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(aside, self._path(number))

    def seal(self) -> str:
        """Write the manifest with all checksums; returns the SHA-256 over them, the data's own checksum."""
        sums = {str(k): file_sha256(self._path(k)) for k in range(self.shards)}
        total = hashlib.sha256("".join(sums.values()).encode()).hexdigest()
        self._save({**self._header(), "sha256": sums, "checksum": total})
        for leftover in self.folder.glob("*.tmp"):
            leftover.unlink(missing_ok=True)
        return total

    @property
    def sealed(self) -> bool:
        """Whether all shards were once there and listed."""
        return "checksum" in self._manifest()

    @property
    def checksum(self) -> str:
        """SHA-256 of the sealed set; ``UserError`` where it isn't sealed yet."""
        try:
            return str(self._manifest()["checksum"])
        except KeyError:
            raise UserError(f"{self.folder}: the set is not complete; run synthesize again to go on") from None

    def read(self) -> Arrays:
        """Every array, joined over the shards in order."""
        parts = [np.load(self._path(k), allow_pickle=False) for k in range(self.shards)]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0].files}

    def _path(self, number: int) -> Path:
        return self.folder / f"shard-{number:05d}.npz"

    def _sound(self, number: int, checksum: str | None) -> bool:
        path = self._path(number)
        return path.is_file() and (checksum is None or file_sha256(path) == checksum)

    def _header(self) -> dict[str, Any]:
        return {"format": FORMAT, "format_version": VERSION, "request": self.request, "shards": self.shards}

    def _manifest(self) -> dict[str, Any]:
        return dict(json.loads((self.folder / MANIFEST).read_text(encoding="utf-8")))

    def _claim(self) -> None:
        if not (self.folder / MANIFEST).exists():
            self._save(self._header())
            return
        found = self._manifest()
        same = {key: found.get(key) for key in self._header()} == json.loads(json.dumps(self._header()))
        if not same:
            raise UserError(f"{self.folder}: holds trials of another request; give another out= or remove the folder")

    def _save(self, manifest: dict[str, Any]) -> None:
        aside = self.folder / f"{MANIFEST}.{os.getpid()}.tmp"
        aside.write_text(json.dumps(manifest, indent=1, sort_keys=True), encoding="utf-8")
        os.replace(aside, self.folder / MANIFEST)


def file_sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def request_key(request: dict[str, Any]) -> str:
    """Short name of a request: the same for equal plain data."""
    return hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest()[:12]


def fill(
    store: ShardStore,
    compute: Callable[[int], Arrays],
    spread: Callable[[Callable[[int], Arrays], Iterable[int]], Iterator[tuple[int, Arrays]]],
    progress: Callable[[int], None],
) -> str:
    """Compute and write the missing shards, ``spread`` over workers; ``progress`` gets each number done."""
    for number, arrays in spread(compute, store.missing()):
        store.write(number, arrays)
        progress(number)
    return store.seal()

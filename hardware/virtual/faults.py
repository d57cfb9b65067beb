"""What can happen to bytes on a line, drawn from a seed or armed one by one."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping

import numpy as np

LONGEST_DELAY_S = 3.0


def _noise(data: bytes, rng: np.random.Generator) -> bytes:
    """A few random bytes somewhere."""
    at = int(rng.integers(0, len(data) + 1))
    return data[:at] + rng.bytes(int(rng.integers(1, 9))) + data[at:]


def _corrupt(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three bits turned over."""
    damaged = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        damaged[int(rng.integers(0, len(damaged)))] ^= 1 << int(rng.integers(0, 8))
    return bytes(damaged)


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    """The end lost."""
    return data[: int(rng.integers(0, len(data)))]


def _gap(data: bytes, rng: np.random.Generator) -> bytes:
    """A stretch lost, as by an overrun buffer."""
    low, high = sorted(int(k) for k in rng.integers(0, len(data) + 1, 2))
    return data[:low] + data[high:]


DAMAGE: Mapping[str, Callable[[bytes, np.random.Generator], bytes]] = {
    "noise": _noise,
    "corrupt": _corrupt,
    "cut": _cut,
    "gap": _gap,
    "drop": lambda _data, _rng: b"",
    "repeat": lambda data, _rng: data + data,
    "late": lambda data, _rng: data,
}
"""What becomes of a message's bytes, by the fault's name; ``late`` delays it by up to three seconds."""


class Faults:
    """Faults of one line, one direction."""

    def __init__(self, seed: np.random.SeedSequence | int = 0, share: Mapping[str, float] | None = None) -> None:
        """``share``: probability of each kind per message; raises ``KeyError`` for a kind there is none of."""
        self.injected: Counter[str] = Counter()
        self._rng = np.random.default_rng(seed)
        self._share = dict(share or {})
        if unknown := set(self._share) - set(DAMAGE):
            raise KeyError(f"no faults {sorted(unknown)}: choose from {sorted(DAMAGE)}")
        self._armed: deque[str | None] = deque()

    def arm(self, kind: str, after: int = 0) -> None:
        """Let a message suffer ``kind``: the next one, or that ``after`` so many whole ones."""
        if kind not in DAMAGE:
            raise KeyError(kind)
        self._armed.extend([None] * after)
        self._armed.append(kind)

    def disarm(self) -> int:
        """Drop the faults still armed; how many they were."""
        left = sum(kind is not None for kind in self._armed)
        self._armed.clear()
        return left

    def suffered(self, data: bytes) -> tuple[float, bytes]:
        """Delay in seconds, and what is left of a message."""
        kind = self._drawn()
        if kind is None or not data:
            return 0.0, data
        self.injected[kind] += 1
        delay = float(self._rng.uniform(0.1, LONGEST_DELAY_S)) if kind == "late" else 0.0
        return delay, DAMAGE[kind](data, self._rng)

    def _drawn(self) -> str | None:
        if self._armed:
            return self._armed.popleft()
        for kind, probability in self._share.items():
            if self._rng.random() < probability:
                return kind
        return None

"""What was truly done to the skin beside what a method said, frame by frame: the input of every metric."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def force_map_n(contact_m: Array, force_n: Array, taxel_m: Array) -> Array:
    """(N,n) newton on each of the n taxels: every contact's force at the taxel nearest to it.

    ``contact_m`` (N,C,2) in metres with NaN for an absent contact, ``force_n`` (N,C), ``taxel_m`` (n,2).
    """
    maps = np.zeros((len(contact_m), len(taxel_m)))
    frames, slots = np.nonzero(np.isfinite(contact_m).all(axis=-1))
    distance = np.linalg.norm(contact_m[frames, slots, None, :] - taxel_m, axis=-1)
    np.add.at(maps, (frames, distance.argmin(axis=1)), force_n[frames, slots])
    return maps


@dataclass(frozen=True, eq=False)
class Outcome:
    """N frames, n taxels; forces in newton, places in metres.

    ``true_map_n`` (N,n): the force truly on each taxel, 0 where there is none. ``map_n`` (N,n): the estimate.
    ``present`` (N,n): where the method says there is a contact. ``contact_m`` (N,C,2): the true places, NaN for an
    absent contact; the touched taxels' places where not given. ``located_m`` (N,D,2): places a method gives directly,
    instead of through its map. Raises ``ValueError`` for shapes that don't fit or an estimate that isn't finite.
    """

    true_map_n: Array
    map_n: Array
    present: Flags
    taxel_m: Array
    contact_m: Array | None = None
    located_m: Array | None = None

    def __post_init__(self) -> None:
        expected = (len(self.true_map_n), len(self.taxel_m))
        for name in ("true_map_n", "map_n", "present"):
            found = getattr(self, name).shape
            if found != expected:
                raise ValueError(f"{name} has shape {found}, expected {expected} (frames, taxels)")
        if not np.isfinite(self.map_n).all():
            raise ValueError("the estimated force map holds values that are not finite")

    @cached_property
    def touched(self) -> Flags:
        """(N,n) the taxels truly touched."""
        return self.true_map_n > 0

    @cached_property
    def contacts(self) -> NDArray[np.int64]:
        """(N,) how many taxels are truly touched."""
        return self.touched.sum(axis=1)

    @cached_property
    def believed_map_n(self) -> Array:
        """(N,n) the estimate where a contact is declared, 0 elsewhere: a missed contact counts as zero force."""
        return np.where(self.present, self.map_n, 0.0)

    def __getitem__(self, frames: Flags) -> Outcome:
        """The frames selected, as an outcome of their own."""
        return Outcome(
            self.true_map_n[frames],
            self.map_n[frames],
            self.present[frames],
            self.taxel_m,
            None if self.contact_m is None else self.contact_m[frames],
            None if self.located_m is None else self.located_m[frames],
        )

    def with_contacts(self, count: int) -> Outcome:
        """The frames with exactly ``count`` touched taxels."""
        return self[self.contacts == count]

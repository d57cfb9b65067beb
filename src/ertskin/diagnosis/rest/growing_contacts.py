"""Contacts that grow or shrink many times over along a course: followed on the sheet solved in full.

Where driven electrodes aren't read a contact shows by what its pad shunts, which is linear neither in its resistance
nor in its logarithm: read off the slope at the mean, what grows tenfold seems to grow threefold, or to less than none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.diagnosis.linear.calibration_vector import CONTACT_SPREAD
from ertskin.diagnosis.rest.settling_contacts import Settling

Array = NDArray[np.float64]
ScanOf = Callable[[Array], tuple[Array, Array]]
"""The scan (P,) of contacts (L,) in ohm, in units of the noise, and its derivatives (P,L) by their logarithms."""

STATES = 12
"""States along the course that are solved at most, the first close together; frames between are interpolated."""
LEAST_BEGUN = 0.05
"""Part of its resistance at the mean with which a contact begins at least, at either end of its path."""
FARTHEST = 6.0
"""Logarithm of a contact's resistance over that at the mean, beyond which none is tried."""


def grown(
    settling: Settling, change: Array, level: Array, ohm: Array, scan_of: ScanOf
) -> tuple[dict[int, Array], Array]:
    """(R,) resistances of the contacts that settle, over those in ``ohm`` (L,): what explains the rest frames' changes
    (R,P) from the scan with those, in units of the noise, best; and the changes that they make.

    Resistances go along the course, from one end to the other; all other contacts stay. Of changes along ``level``
    (P,), the whole sheet's, nothing is asked: it may do anything in any frame.
    """
    which, unit = sorted(settling.size), level / np.linalg.norm(level)
    way = (settling.course - settling.course.min()) / np.ptp(settling.course)
    solved = lru_cache(maxsize=1)(_Between(which, way, unit, ohm, scan_of, _uneven(scan_of(ohm)[0], unit)))
    wanted = change - np.outer(change @ unit, unit)

    def residual(ends: Array) -> Array:
        # What the readings hardly tell stays where it is.
        return np.append(wanted - solved(tuple(ends))[0], ends / CONTACT_SPREAD)

    def slope(ends: Array) -> Array:
        by = solved(tuple(ends))[1].reshape(-1, len(ends))
        return np.vstack([-by, np.eye(len(ends)) / CONTACT_SPREAD])

    size = np.array([settling.size[k] for k in which])
    ends = [1 + size * end for end in (settling.course.min(), settling.course.max())]
    begun = np.log(np.maximum(np.concatenate(ends), LEAST_BEGUN))
    found = least_squares(residual, begun, slope, bounds=(-FARTHEST, FARTHEST), max_nfev=20)
    relative = np.array([_part(found.x, along)[0] for along in way])
    return dict(zip(which, relative.T, strict=True)), solved(tuple(found.x))[0]


@dataclass(frozen=True, eq=False)
class _Between:
    """What contacts do that go from one end to the other: ``which`` of those in ``ohm`` (L,), each frame part of the
    ``way`` (R,), in changes from the scan ``still`` (P,) without what goes along ``unit`` (P,)."""

    which: list[int]
    way: Array
    unit: Array
    ohm: Array
    scan_of: ScanOf
    still: Array

    def __call__(self, ends: tuple[float, ...]) -> tuple[Array, Array]:
        """Changes (R,P) and their derivatives (R,P,2n) by the logarithms of both ends; frames between the states that
        are solved interpolated."""
        ways = np.unique(self.way)
        state = ways[np.unique(np.geomspace(1, len(ways), STATES).round().astype(int)) - 1]
        between = np.array([np.interp(self.way, state, one) for one in np.eye(len(state))]).T
        scans, slopes = zip(*(self._state(np.array(ends), along) for along in state), strict=True)
        return between @ np.array(scans), np.tensordot(between, np.array(slopes), 1)

    def _state(self, ends: Array, along: float) -> tuple[Array, Array]:
        contacts = self.ohm.copy()
        relative, by_ends = _part(ends, along)
        contacts[self.which] *= relative
        scan, slope = self.scan_of(contacts)
        return _uneven(scan, self.unit) - self.still, np.tile(_uneven(slope[:, self.which], self.unit), 2) * by_ends


def _part(ends: Array, along: float) -> tuple[Array, Array]:
    """(n,) resistances over those at the mean so far ``along`` the way, and the derivatives (2n,) of their logarithms
    by those of both ends."""
    first, last = np.split(np.exp(ends), 2)
    shares = (1 - along) * first, along * last
    return shares[0] + shares[1], np.hstack(shares) / np.tile(shares[0] + shares[1], 2)


def _uneven(scan: Array, unit: Array) -> Array:
    """A scan or derivatives (P,...) without what goes along the ``unit`` vector (P,)."""
    return np.asarray(scan - np.multiply.outer(unit, unit @ scan))

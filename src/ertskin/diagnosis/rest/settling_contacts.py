"""Contacts that settle while nothing presses: one course in time for all, a size for each.

A contact free in every frame must wander by twice its error to be seen; along one course all frames count together,
and a contact of a fifth of that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PACES_S = 20.0, 100.0, 500.0
"""Times after the first frame from which on contacts settle with the logarithm of time."""
SURELY = 5.0
"""Standard deviations of chance that a contact's size along the course must exceed, counted in what all contacts leave
of it, and by which what is left there may exceed chance."""
FEW_OF = 2
"""Of so many contacts one, at least, makes few of them: more than that would make up a pattern of any kind."""


class Settling(NamedTuple):
    """``size`` of each contact that settles, the share of its resistance along the ``course`` (R,); ``explained``
    chi-square, nought if none does."""

    size: dict[int, float]
    course: Array
    explained: float

    @property
    def path(self) -> dict[int, Array]:
        """(R,) shares of each contact's resistance."""
        return {contact: size * self.course for contact, size in self.size.items()}

    def done(self, columns: Array) -> Array:
        """(R,P) what they change, by columns (P,n) of which each contact's is at its number."""
        pattern = columns[:, list(self.size)] @ np.array(list(self.size.values()))
        return np.multiply.outer(self.course, pattern)


NONE_SETTLES = Settling({}, np.zeros(0), 0.0)


def settling_contacts(change: Array, designs: Sequence[Array], time_s: Array) -> Settling:
    """The contacts that settle together, by the rest frames' changes (R,P), in units of the noise, at times (R,) since
    the first frame.

    ``designs`` (R of (P,L+1)), in the same units: what the L contacts do and, last, the whole sheet, which may do
    anything in any frame.
    None where more changes along the course than they explain: then something else does.
    """
    if not np.ptp(time_s) > 0 or change.shape[1] <= designs[0].shape[1]:
        # No course, or no number that contacts and sheet leave to tell them from anything else.
        return NONE_SETTLES
    found = [_along(change, designs, np.log1p(time_s / pace_s)) for pace_s in PACES_S]
    return max(found, key=lambda one: one.explained)


def _along(change: Array, designs: Sequence[Array], course: Array) -> Settling:
    """The contacts that go along one course (R,)."""
    course = course - course.mean()
    count, contacts = change.shape[1], designs[0].shape[1] - 1
    gram, pull, along = np.zeros((contacts, contacts)), np.zeros(contacts), np.zeros(count)
    for row, design, size in zip(change, designs, course, strict=True):
        level = design[:, -1] / np.linalg.norm(design[:, -1])
        uneven, columns = row - level * (level @ row), design[:, :-1] - np.outer(level, level @ design[:, :-1])
        gram += size**2 * columns.T @ columns
        pull += size * columns.T @ uneven
        along += size * uneven
    total = float(along @ along) / float(course @ course)
    left = total - _explained(gram, pull, list(range(contacts)))[0]
    least = SURELY**2 * max(1.0, left / max(1, count - 1 - contacts))
    chosen: list[int] = []
    explained, share = 0.0, np.zeros(0)
    while len(chosen) < contacts // FEW_OF:
        tried = [([*chosen, k], *_explained(gram, pull, [*chosen, k])) for k in range(contacts) if k not in chosen]
        more, part, size_of = max(tried, key=lambda one: one[1])
        if part - explained < least:
            break
        chosen, explained, share = more, part, size_of
    freedom = count - 1 - len(chosen)
    if not chosen or total - explained > freedom + SURELY * np.sqrt(2 * freedom):
        return NONE_SETTLES
    return Settling(dict(zip(chosen, map(float, share), strict=True)), course, explained)


def _explained(gram: Array, pull: Array, chosen: list[int]) -> tuple[float, Array]:
    """Chi-square that some contacts explain along a course, and the size of each."""
    size = np.linalg.lstsq(gram[np.ix_(chosen, chosen)], pull[chosen], rcond=None)[0]
    return float(size @ pull[chosen]), np.asarray(size)

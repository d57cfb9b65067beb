"""What a method says of contacts anywhere, beside the truth: no taxels, any number of contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ertskin.models.estimate import Estimate

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ContactOutcome:
    """N frames: true contacts (N,C) beside said ones (N,D), NaN for none; metres and newton.

    ``covariance`` (N,D,3,3) of x, y and force where the method says how sure it is. ``taxel_m`` (n,2): by which scores
    are drawn over the sheet.
    """

    true_m: Array
    true_n: Array
    said_m: Array
    said_n: Array
    taxel_m: Array
    covariance: Array | None = None

    @cached_property
    def true_count(self) -> NDArray[np.int64]:
        """(N,) contacts there are."""
        return np.isfinite(self.true_m).all(axis=-1).sum(axis=1)

    @cached_property
    def said_count(self) -> NDArray[np.int64]:
        """(N,) contacts said."""
        return np.isfinite(self.said_n).sum(axis=1)

    @cached_property
    def pairs(self) -> tuple[Indices, Indices, Indices]:
        """(M,) frame, true slot and said slot of the contacts that belong together: least total distance."""
        frames, trues, saids = [], [], []
        for frame in range(len(self.true_n)):
            present = np.flatnonzero(np.isfinite(self.true_m[frame]).all(axis=-1))
            said = np.flatnonzero(np.isfinite(self.said_n[frame]))
            away = np.linalg.norm(self.true_m[frame][present][:, None] - self.said_m[frame][said], axis=-1)
            a, b = linear_sum_assignment(away)
            frames.append(np.full(len(a), frame))
            trues.append(present[a])
            saids.append(said[b])
        return tuple(np.concatenate(part).astype(np.intp) for part in (frames, trues, saids))  # type: ignore[return-value]

    @cached_property
    def place_error_mm(self) -> Array:
        """(M,) distance of each pair."""
        frame, true, said = self.pairs
        return np.asarray(1e3 * np.linalg.norm(self.true_m[frame, true] - self.said_m[frame, said], axis=1))

    @cached_property
    def force_error_n(self) -> Array:
        """(M,) said less true force of each pair; NaN where the true one isn't known."""
        frame, true, said = self.pairs
        return np.asarray(self.said_n[frame, said] - self.true_n[frame, true])

    @cached_property
    def taxel(self) -> Indices:
        """(M,) the taxel nearest to each pair's true contact."""
        frame, true, _ = self.pairs
        return np.linalg.norm(self.true_m[frame, true][:, None] - self.taxel_m, axis=2).argmin(axis=1)

    @cached_property
    def least_distance_m(self) -> Array:
        """(N,) between any two true contacts of a frame; infinite for one."""
        apart = np.linalg.norm(self.true_m[:, :, None] - self.true_m[:, None], axis=-1)
        apart = np.where(np.isfinite(apart), apart, np.inf) + np.diag(np.full(apart.shape[1], np.inf))
        return np.asarray(apart.min(axis=(1, 2)))


def contacts_said(estimate: Estimate, taxel_m: Array) -> tuple[Array, Array]:
    """(N,D,2) and (N,D) contacts of an estimate: its own, or the taxels it declares."""
    if estimate.contact_m is not None and estimate.contact_force_n is not None:
        return estimate.contact_m, estimate.contact_force_n
    most = max(1, int(estimate.present.sum(axis=1).max(initial=0)))
    order = np.argsort(~estimate.present, axis=1, kind="stable")[:, :most]
    present = np.take_along_axis(estimate.present, order, axis=1)
    force = np.take_along_axis(estimate.force_map_n, order, axis=1)
    return np.where(present[..., None], taxel_m[order], np.nan), np.where(present, force, np.nan)

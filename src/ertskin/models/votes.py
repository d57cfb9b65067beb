"""Taxels' votes for contacts, counted: the part of ``places`` that needs no network, and so no torch."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ertskin.models.estimate import Estimate

Array = NDArray[np.float64]


def grid_spacing_m(taxel_m: Array) -> float:
    """Median distance of a taxel to its nearest neighbour."""
    distance = np.linalg.norm(taxel_m[:, None] - taxel_m[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    return float(np.median(distance.min(axis=1)))


def counted(weight: Array, force_n: Array, place_m: Array, *, radius_m: float, threshold: float) -> tuple[Array, Array]:
    """Contacts (C,2) in metres and (C,) in newton from the votes of n taxels, the weightiest place first.

    Votes within ``radius_m`` of the weightiest one left are one contact: its place and force are their weighted means.
    """
    weights, forces, places = (np.ascontiguousarray(each, dtype=float) for each in (weight, force_n, place_m))
    found = together(weights, forces, places, radius_m, threshold)
    return found[:, :2], found[:, 2]


@njit(cache=True, nogil=True)
def together(weight, force_n, place_m, radius_m, threshold):  # type: ignore[no-untyped-def]
    """(C,3) place and force of ``counted``."""
    found = np.empty((len(weight), 3))
    count, left = 0, weight.copy()
    while len(left):
        first = left.argmax()
        if left[first] <= 0.1 * threshold:
            break
        total, sums = 0.0, np.zeros(3)
        for k in range(len(left)):
            if left[k] <= 0.0:
                continue
            square = (place_m[k, 0] - place_m[first, 0]) ** 2 + (place_m[k, 1] - place_m[first, 1]) ** 2
            if square <= radius_m**2:
                total += left[k]
                sums[0] += left[k] * place_m[k, 0]
                sums[1] += left[k] * place_m[k, 1]
                sums[2] += left[k] * force_n[k]
                left[k] = 0.0
        if total > threshold:
            found[count] = sums / total
            count += 1
    return found[:count]


def on_taxels(found: list[tuple[Array, Array]], taxel_m: Array) -> Estimate:
    """The contacts of N frames as arrays, and each one's force on the taxel nearest to it."""
    most = max((len(forces) for _, forces in found), default=0)
    contact_m = np.full((len(found), most, 2), np.nan)
    contact_force_n = np.full((len(found), most), np.nan)
    for frame, (places, forces) in enumerate(found):
        contact_m[frame, : len(forces)] = places
        contact_force_n[frame, : len(forces)] = forces
    force_map_n = nearest_taxels(contact_m, contact_force_n, taxel_m)
    return Estimate(force_map_n, force_map_n > 0, contact_m, contact_force_n)


@njit(cache=True, nogil=True)
def nearest_taxels(contact_m, force_n, taxel_m):  # type: ignore[no-untyped-def]
    """(N,n) each contact's force on the taxel (n,2) nearest to it; contacts (N,C,2) with (N,C) newton, NaN for none."""
    laid = np.zeros((len(force_n), len(taxel_m)))
    for frame in range(len(force_n)):
        for c in range(force_n.shape[1]):
            if np.isfinite(force_n[frame, c]):
                best, least = 0, np.inf
                for k in range(len(taxel_m)):
                    dx, dy = contact_m[frame, c, 0] - taxel_m[k, 0], contact_m[frame, c, 1] - taxel_m[k, 1]
                    if dx * dx + dy * dy < least:
                        best, least = k, dx * dx + dy * dy
                laid[frame, best] += force_n[frame, c]
    return laid

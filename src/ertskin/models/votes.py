"""Taxels' votes for contacts, counted: the part of ``places`` that needs no network, and so no torch."""

from __future__ import annotations

import numpy as np
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
    places, forces = [], []
    left = weight.copy()
    while left.max(initial=0.0) > 0.1 * threshold:
        together = (np.linalg.norm(place_m - place_m[left.argmax()], axis=1) <= radius_m) & (left > 0)
        share = left[together]
        if share.sum() > threshold:
            places.append(share @ place_m[together] / share.sum())
            forces.append(share @ force_n[together] / share.sum())
        left[together] = 0.0
    return np.array(places).reshape(-1, 2), np.array(forces)


def on_taxels(found: list[tuple[Array, Array]], taxel_m: Array) -> Estimate:
    """The contacts of N frames as arrays, and each one's force on the taxel nearest to it."""
    most = max((len(forces) for _, forces in found), default=0)
    contact_m = np.full((len(found), most, 2), np.nan)
    contact_force_n = np.full((len(found), most), np.nan)
    force_map_n = np.zeros((len(found), len(taxel_m)))
    for frame, (places, forces) in enumerate(found):
        contact_m[frame, : len(forces)] = places
        contact_force_n[frame, : len(forces)] = forces
        taxel = np.linalg.norm(places[:, None] - taxel_m, axis=-1).argmin(axis=1) if len(forces) else []
        np.add.at(force_map_n[frame], taxel, forces)
    return Estimate(force_map_n, force_map_n > 0, contact_m, contact_force_n)

"""Distance between true contacts and where they are said to be, in millimetres."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from ertskin.evaluation.metrics.score import Array, Score
from ertskin.evaluation.outcome import Outcome


def _centroids_m(weight_n: Array, taxel_m: Array, contact_m: Array, blind_m: Array) -> Array:
    """(C,2) force-weighted mean of the declared taxels nearest to each true contact (C,2); ``blind_m`` where none."""
    nearest = np.linalg.norm(taxel_m[:, None] - contact_m, axis=-1).argmin(axis=1)
    share = weight_n * (nearest == np.arange(len(contact_m))[:, None])
    total = share.sum(axis=1, keepdims=True)
    return np.where(total > 0, share @ taxel_m / np.where(total > 0, total, 1.0), blind_m)


def _assigned_m(located_m: Array, contact_m: Array, blind_m: Array) -> Array:
    """(C,2) the places given directly (D,2), assigned one to one by least distance; ``blind_m`` where too few."""
    matched = np.tile(blind_m, (len(contact_m), 1))
    distance = np.linalg.norm(contact_m[:, None] - located_m, axis=-1)
    contacts, places = linear_sum_assignment(distance)
    matched[contacts] = located_m[places]
    return matched


def location_error_mm(outcome: Outcome) -> Score:
    """Mean distance in millimetre over all true contacts; per taxel by the taxel nearest to the contact.

    From a map, a contact's place is the force-weighted mean of the declared taxels that lie nearer to it than to any
    other true contact, so a ghost pulls it away. Places given directly are assigned one to one. A missed contact is
    placed at the taxels' centre: where one would guess who knows nothing.
    """
    taxel_m = outcome.taxel_m
    blind_m = taxel_m.mean(axis=0)
    weight_n = np.clip(outcome.believed_map_n, 0.0, None)
    distances, taxels = [], []
    for frame in np.flatnonzero(outcome.contacts):
        true_m = taxel_m[outcome.touched[frame]]
        if outcome.contact_m is not None:
            true_m = outcome.contact_m[frame][np.isfinite(outcome.contact_m[frame]).all(axis=-1)]
        if outcome.located_m is None:
            found_m = _centroids_m(weight_n[frame], taxel_m, true_m, blind_m)
        else:
            places_m = outcome.located_m[frame]
            found_m = _assigned_m(places_m[np.isfinite(places_m).all(axis=-1)], true_m, blind_m)
        distances.append(1e3 * np.linalg.norm(found_m - true_m, axis=-1))
        taxels.append(np.linalg.norm(true_m[:, None] - taxel_m, axis=-1).argmin(axis=1))
    if not distances:
        return Score("location_error_mm", float("nan"), np.full(len(taxel_m), np.nan))
    distance, taxel = np.concatenate(distances), np.concatenate(taxels)
    count = np.bincount(taxel, minlength=len(taxel_m))
    total = np.bincount(taxel, weights=distance, minlength=len(taxel_m))
    per_taxel = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return Score("location_error_mm", float(distance.mean()), per_taxel)

"""A claim's map with what is known of it: errors, where it is determined, and how likely it is right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.contract.claims import FieldMap
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.judge.map_probability import (
    FieldPosterior,
    Places,
    errors_among,
    posteriors_from,
    right_among,
    tell,
    with_fitted,
)
from ertskin.diagnosis.judge.undetermined_field import MOST_LEFT, known_at
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.pressed_places import pressed_places_m
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.hypothesis import Need
from ertskin.physics.effects.smooth_field import Nodes, field_at

Array = NDArray[np.float64]
CovarianceAt = Callable[[Array], Array | None]
"""What a fit leaves of a field's covariance (n,n) at points (n,2); None of a field that isn't smooth."""

NEXT_TO_M = 2e-3
"""As far from a place pressed as what is told there holds: well within what a press of the paper's indenter covers."""


def known_map(field: FieldMap, effect: Effect, selection: Selection) -> FieldMap:
    """The effect's map with what is known of it."""
    smooth = smooth_part(effect, selection)
    if smooth is not None:
        return smooth.known(field)
    return _as_fitted(field, effect.name, selection.after, selection.problem.evidence.sensor.extent_m)


def determined_points(selection: Selection) -> list[tuple[str, int, int]]:
    """The smooth fields of a fit by name, at how many of the sensing points each is determined, and of how many."""
    sensor, found = selection.problem.evidence.sensor, []
    for term in selection.after.terms:
        value = None if term.modes is None else term.effect.map_at(sensor.taxel_m, sensor.extent_m)
        known = None if value is None else known_map(FieldMap(sensor.taxel_m, value), term.effect, selection)
        if known is not None and known.determined is not None:
            found.append((term.name, int(known.determined.sum()), len(known.determined)))
    return found


def _as_fitted(field: FieldMap, name: str, solved: Solved, extent_m: Array) -> FieldMap:
    """The map with what the fit knows of it, where a smooth field of this name is in it."""
    taxels = None if field.taxels is None else _as_fitted(field.taxels, name, solved, extent_m)
    known = known_at(solved, extent_m, field.point_m).get(name)
    if known is None:
        return replace(field, taxels=taxels)
    found = replace(field, error=known.error, determined=known.determined, taxels=taxels)
    return _judged(found, [FieldPosterior(0.0, field.value, known.covariance)])


def smooth_part(effect: Effect, selection: Selection) -> SmoothPart | None:
    """The smooth field of an effect that presses alone show, by its values where something has pressed; None of another
    field, and where such places are too few.

    A fit leaves no doubt of other places where its covariance predicts a few presses by luck: alone it says 1.00 of
    maps of which half are right.
    """
    nodes = getattr(effect, "nodes", ())
    if not nodes or Need.PRESSES not in effect.hypothesis.needs:
        return None
    extent_m, place_m = selection.problem.evidence.sensor.extent_m, pressed_places_m(selection.problem)
    known = known_at(selection.after, extent_m, place_m)[effect.name]
    places = Places(place_m, field_at(nodes, place_m, extent_m), known.error)
    return SmoothPart(nodes, extent_m, places, fitted_covariance(effect, selection)) if tell(places) else None


def fitted_covariance(effect: Effect, selection: Selection) -> CovarianceAt:
    """What the fit leaves of the covariance of an effect's field."""
    solved, extent_m = selection.after, selection.problem.evidence.sensor.extent_m

    def at(point_m: Array) -> Array | None:
        known = known_at(solved, extent_m, point_m).get(effect.name)
        return None if known is None else known.covariance

    return at


@dataclass(frozen=True, eq=False)
class SmoothPart:
    """What of a field no form of few numbers gives, by its values at places and by what a fit leaves between them."""

    nodes: Nodes
    extent_m: Array
    places: Places
    covariance_at: CovarianceAt

    def known(self, field: FieldMap) -> FieldMap:
        """The map with how well the places tell it."""
        taxels = None if field.taxels is None else self.known(field.taxels)
        form = field.value - field_at(self.nodes, field.point_m, self.extent_m)
        side_m = float(np.ptp(self.extent_m, axis=0).max())
        posteriors = [replace(one, mean=form + one.mean) for one in posteriors_from(self.places, field.point_m, side_m)]
        error = errors_among(field.value, posteriors)
        determined = error < MOST_LEFT * float(np.std(self.places.value))
        found = replace(field, error=error, determined=determined, taxels=taxels)
        return _judged_by_both(found, posteriors, self.covariance_at)


def where_pressed(field: FieldMap, places: Places, side_m: float, covariance_at: CovarianceAt) -> FieldMap:
    """The map, determined next to the places alone, on a sheet of this longer side: how sure a smooth field would be
    elsewhere makes none determined there."""
    taxels = None if field.taxels is None else where_pressed(field.taxels, places, side_m, covariance_at)
    apart_m = np.linalg.norm(field.point_m[:, None] - places.point_m, axis=-1).min(axis=1)
    determined = apart_m <= NEXT_TO_M
    found = replace(field, error=None, determined=determined, taxels=taxels)
    if taxels is not None:
        return found
    return _judged_by_both(found, posteriors_from(places, field.point_m, side_m), covariance_at)


def _judged(field: FieldMap, posteriors: Sequence[FieldPosterior]) -> FieldMap:
    """The map with how likely it is right where the field is what one of the ``posteriors`` says; where it has a map of
    its sensing points that one bears it."""
    if field.taxels is not None or field.determined is None:
        return field
    right = right_among(field.value, posteriors, field.determined)
    return replace(field, right=right.determined, right_everywhere=right.everywhere)


def _judged_by_both(field: FieldMap, posteriors: Sequence[FieldPosterior], covariance_at: CovarianceAt) -> FieldMap:
    """The map with how likely it is right by the ``posteriors`` that values at places tell and by what a fit leaves;
    by places alone where these tell nothing."""
    if field.taxels is not None:
        return field
    covariance = covariance_at(field.point_m) if posteriors else None
    return _judged(field, posteriors if covariance is None else with_fitted(posteriors, field.value, covariance))

"""What a claim says in any form of its effect: quantities under stated conditions, and the field over the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ertskin.diagnosis.contract.claims import QUANTILE, Claim, Estimate, FieldMap
from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.force.fit import ForceFit
from ertskin.diagnosis.judge.confidence import explained, reasoned
from ertskin.diagnosis.judge.known_map import fitted_covariance, known_map, where_pressed
from ertskin.diagnosis.judge.map_probability import Places
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.judge.undetermined_field import known_at
from ertskin.diagnosis.linear.calibration_vector import SkinFamily
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.baseline import Baseline
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.pressed_places import logarithms, pressed_places_m
from ertskin.physics.conduction.mesh import inside_polygon
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.standard import Standard
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

GRID = 24
"""Points of a map along the longer side of the sheet."""
STEP = 0.3
"""Standard errors by which parameters are moved to see what a quantity owes them."""
SMOOTH = 0.2
"""Part of its size to which a quantity of a field given at nodes is supposed to be known: their errors aren't kept."""
SHIFT = ("dx_m", "dy_m")
"""Quantities that are the components of one shift."""
UNITS = {"_v": "V", "_m": "m"}
"""By how a quantity's name ends; without one it is a ratio."""


@dataclass(frozen=True, eq=False)
class Spread:
    """The free parameters of an effect and their covariance, in each way it was estimated: the widest counts."""

    free: tuple[str, ...] = ()
    covariance: tuple[Array, ...] = ()

    @classmethod
    def of(cls, estimates: dict[str, Estimate]) -> Spread:
        """From intervals alone: parameters taken as independent."""
        error = [(e.high - e.low) / (2 * QUANTILE) for e in estimates.values()]
        return cls(tuple(estimates), (np.diag(np.square(error)),))

    @property
    def error(self) -> Array:
        """(n,) standard errors."""
        return np.sqrt(np.maximum(np.max([np.diag(c) for c in self.covariance], axis=0), 0.0))


def with_quantities(findings: Findings, family: SkinFamily) -> Findings:
    """The answer of a skin's recording with the quantities and maps of its claims."""
    evidence, baseline, selection = findings.evidence, findings.baseline, findings.selection
    if evidence is None or baseline is None or selection is None:
        return findings
    standard = _standard(evidence, baseline, selection.after, family)
    stated_claims = (
        stated(claim, standard, _spread(claim, selection.after, baseline.force_best), evidence.sensor)
        for claim in findings.diagnosis.claims
    )
    claims = largest_alone([_of_field(claim, selection, standard) for claim in stated_claims])
    return replace(findings, diagnosis=replace(findings.diagnosis, claims=claims))


def with_fields_of_all_presses(findings: Findings, family: SkinFamily) -> Findings:
    """The answer with maps and quantities of fields from the fit to all presses, where there is one that holds them.

    Names and how sure they are stay as judged by presses held out; a map of more presses is the better map, unless it
    is of a form of few numbers in place of a smooth one. What is told place by place, which predicts none, is no surer
    than all presses make it: of a cut that opens the few fitted were explained whole, a third of all (c031 of
    `seventh48`).
    """
    evidence, baseline, whole = findings.evidence, findings.baseline, findings.whole
    if evidence is None or baseline is None or whole is None:
        return findings
    standard = _standard(evidence, baseline, whole.after, family)
    terms = {term.name: term for term in whole.after.terms if term.effect.hypothesis.field}

    def of_all(claim: Claim) -> Claim:
        claim = as_sure_as_all(claim, whole, evidence.criteria)
        if claim.effect.name not in terms:
            return claim
        term = terms[claim.effect.name]
        fitted = replace(claim, effect=term.effect, parameters={})
        fitted = stated(fitted, standard, _spread(fitted, whole.after, None), evidence.sensor)
        known = _of_field(fitted, whole, standard)
        if known.right_map is None and claim.right_map is not None:
            # A form of few numbers says nothing of how well it is known.
            return claim
        return replace(claim, quantities=known.quantities, field_map=known.field_map)

    claims = tuple(map(of_all, findings.diagnosis.claims))
    return replace(findings, diagnosis=replace(findings.diagnosis, claims=claims))


def as_sure_as_all(claim: Claim, whole: Selection, criteria: Criteria) -> Claim:
    """A claim told by places, at most as sure as all presses make it; half as sure where they don't tell it so."""
    if not claim.by_place:
        return claim
    pair = next((one.by_place for one in whole.chosen if one.term.name == claim.effect.name), None)
    most = criteria.doubted_share * claim.confidence if pair is None else explained(*pair, criteria)
    judged = replace(claim, confidence=min(claim.confidence, most))
    return reasoned([claim], [judged], "all_presses", "one number for every place explains less of all presses")[0]


def _standard(evidence: Evidence, baseline: Baseline, solved: Solved, family: SkinFamily) -> Standard:
    """The conditions that a skin's recording sets, its fabric as fitted."""
    return replace(
        standard_of(evidence.sensor, evidence.protocol, evidence.history),
        resistance=family.skin(solved.calibration, ()).piezo.sheet_resistance_ohm_sq,
        largest_pa=float(np.nanmax(baseline.specimen.stress_pa)),
        contact_ohm=np.array(solved.calibration.contact_ohm),
    )


def _of_field(claim: Claim, selection: Selection, standard: Standard) -> Claim:
    """The claim with what the fit knows of its map, and by how much places differ where it is told by them."""
    if claim.field_map is None:
        return claim
    if not claim.by_place:
        return replace(claim, field_map=known_map(claim.field_map, claim.effect, selection))
    place_m = pressed_places_m(selection.problem)
    value = logarithms(claim.effect, place_m, standard.extent_m)
    known = known_at(selection.after, standard.extent_m, place_m).get(claim.effect.name)
    places = Places(place_m, value, np.zeros(len(value)) if known is None else known.error)
    side_m = float(np.ptp(standard.extent_m, axis=0).max())
    quantities = claim.quantities | {"log_spread": spread_of(value)}
    found = where_pressed(claim.field_map, places, side_m, fitted_covariance(claim.effect, selection))
    return replace(claim, field_map=found, quantities=quantities)


def spread_of(sample: Array) -> Estimate:
    """Standard deviation of what (n,) were drawn from, two at least, with its interval at 90 % for normal values."""
    free = len(sample) - 1
    value = float(np.std(sample, ddof=1))
    low, high = value * np.sqrt(free / chi2.ppf([0.95, 0.05], free))
    return Estimate(value, float(low), float(high), "1")


def largest_alone(claims: Sequence[Claim]) -> tuple[Claim, ...]:
    """The claims; a quantity that is the largest of several (``largest_...``) stays with the one that has it, of the
    surest of an effect."""

    def is_largest(claim: Claim, name: str) -> bool:
        if not name.startswith("largest_"):
            return True
        alike = [c for c in claims if c.effect.name == claim.effect.name and name in c.quantities]
        return claim is max(alike, key=lambda c: (c.confidence, abs(c.quantities[name].value)))

    return tuple(replace(c, quantities={n: e for n, e in c.quantities.items() if is_largest(c, n)}) for c in claims)


def stated(claim: Claim, standard: Standard, spread: Spread, sensor: Sensor | None = None) -> Claim:
    """The claim with its quantities' intervals, and its map where the effect has a field over ``sensor``'s sheet."""
    found = quantities(claim.effect, standard, spread)
    return replace(claim, quantities=found, field_map=None if sensor is None else field_map(claim.effect, sensor))


def quantities(effect: Effect, standard: Standard, spread: Spread) -> dict[str, Estimate]:
    """Each quantity with its interval at 90 %, by its derivatives at the parameters found, and to what it would be with
    what no reading tells; those unknown left out."""
    values, unseen = effect.quantities(standard), effect.unseen(standard)
    moved = [_slope(effect, standard, key, error) for key, error in zip(spread.free, spread.error, strict=True)]
    found = {}
    for name, value in values.items():
        slope = np.array([one.get(name, 0.0) for one in moved])
        error = max((float(np.sqrt(max(slope @ c @ slope, 0.0))) for c in spread.covariance), default=0.0)
        least = SMOOTH if getattr(effect, "nodes", ()) else effect.form_error
        half = max(QUANTILE * error, least * _size(values, name))
        if np.isfinite([value, half]).all():
            other = unseen.get(name, value)
            low, high = min(value - half, other), max(value + half, other)
            found[name] = Estimate(value, low, high, UNITS.get(name[-2:], "1"))
    return found


def _size(values: dict[str, float], name: str) -> float:
    """What a quantity's form error is a share of: of a shift's components the whole shift, however it is turned."""
    return float(np.linalg.norm([values.get(key, 0.0) for key in (SHIFT if name in SHIFT else (name,))]))


def field_map(effect: Effect, sensor: Sensor) -> FieldMap | None:
    """The effect's field at the points of a square grid that lie in the sheet, and at the sensing points, where it has
    one."""
    low, high = sensor.extent_m
    step_m = float((high - low).max()) / GRID
    x, y = (np.arange(a + 0.5 * step_m, b, step_m) for a, b in zip(low, high, strict=True))
    point = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    point = point[inside_polygon(point, sensor.outline_m)]
    value, at_taxels = (effect.map_at(where, sensor.extent_m) for where in (point, sensor.taxel_m))
    if value is None or at_taxels is None:
        return None
    return FieldMap(point, value, taxels=FieldMap(sensor.taxel_m, at_taxels) if len(sensor.taxel_m) else None)


def standard_of(sensor: Sensor, protocol: Protocol, history: History) -> Standard:
    """The conditions that a skin's recording sets, but for its fabric."""
    depth = history.depth_m
    places = history.contact_m[history.touched]
    return Standard(
        resistance=np.ones_like,
        largest_pa=np.nan,
        deepest_m=float(np.nanmax(depth)) if np.isfinite(depth).any() else np.nan,
        foam_m=sensor.layers[0].thickness_m if sensor.layers else np.nan,
        step_m=history.step_m,
        scan_s=protocol.duration_s or np.nan,
        point_m=sensor.taxel_m,
        pressed_m=np.unique(places[np.isfinite(places).all(axis=-1)], axis=0),
        extent_m=sensor.extent_m,
        sensor=sensor,
    )


def _spread(claim: Claim, solved: Solved, force: ForceFit | None) -> Spread:
    """What the fit that named the effect knows of its parameters; else the intervals claimed."""
    for number, term in enumerate(solved.terms):
        if term.effect == claim.effect and set(term.free) >= set(claim.parameters):
            mine = solved.first(number) + np.arange(len(term.free))
            block = np.ix_(mine, mine)
            inflation = max(1.0, float((solved.scan_residual**2).mean()))
            return Spread(term.free, (inflation * solved.fit.covariance[block], solved.fit.robust_covariance[block]))
    if force is not None and claim.effect in force.effects:
        keys = [key for key in claim.effect.parameters() if f"{claim.effect.name}.{key}" in force.names]
        rows = np.array([force.names.index(f"{claim.effect.name}.{key}") for key in keys], dtype=np.intp)
        return Spread(tuple(keys), (force.covariance[np.ix_(rows, rows)],))
    return Spread.of(claim.parameters)


def _slope(effect: Effect, standard: Standard, key: str, error: float) -> dict[str, float]:
    """Derivatives of all quantities by a parameter, over ``STEP`` of its standard error to either side."""
    if key not in effect.parameters() and "[" not in key:
        # It was measured, not fitted.
        return {}
    known, value = effect.known(key), effect.value(key)
    step = STEP * error if error > 0 else 1e-3 * known.typical
    low, high = max(value - step, known.low), min(value + step, known.high)
    if not high > low:
        return {}
    less, more = (effect.changed({key: v}).quantities(standard) for v in (low, high))
    return {name: (more[name] - less[name]) / (high - low) for name in more if name in less}

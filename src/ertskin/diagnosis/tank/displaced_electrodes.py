"""Electrodes out of place along a tank's rim, as a part of the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ertskin.diagnosis.contract.claims import QUANTILE, Claim, Diagnosis, Estimate, HeldOut, verdict_of
from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.tank.electrode_error import ElectrodeErrors
from ertskin.diagnosis.tank.placement import ACCURACY, Placement, PlacementFit
from ertskin.hardware.recording import Recording
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.effects.registry import measured_as

Array = NDArray[np.float64]

HANDS = 0.06
"""Shift over the radius that gluing by hand may leave, twice its standard deviation: beyond it an electrode is out of
place."""
OWN, FLOOR = 1.3, 0.002
"""Standard error of a shift over the one the fit states, and over the radius what is added: from simulated tanks of
even numbers (experiments/real/ottawa/nulls.py); odd ones judge the confidence that follows."""
UNDETERMINED = (
    "two-dimensional impedance can't tell electrodes that slid along the rim from an outline that changed: conformal "
    "maps of one onto the other leave every reading as it is; nor where all moved as such a map of a disk onto "
    "itself moves them, nor an anisotropic sheet from an outline stretched"
)


def placed(recording: Recording, scan_v: Array, noise_v: float, wrong: ElectrodeErrors) -> Placement | None:
    """The electrodes' places along the rim, where the tank has them there and can be meshed.

    Readings of the electrodes or channels that are ``wrong`` are not used.
    """
    assert recording.sensor is not None
    assert recording.protocol is not None
    if recording.sensor.electrode_edge_m is None:
        return None
    try:
        aside, channels = ((), wrong.named) if wrong.channels else (wrong.named, ())
        return PlacementFit(recording.sensor, recording.protocol, scan_v, noise_v, aside, channels).fit()
    except (MeshError, np.linalg.LinAlgError):
        return None


def with_placement(diagnosis: Diagnosis, found: Placement, criteria: Criteria) -> Diagnosis:
    """The answer with the electrodes out of place, if any are, and with what can't be told."""
    moved = {
        "misfit_before": found.misfit_before,
        "misfit_after": found.misfit_after,
        "model_accuracy": ACCURACY,
        "shift_along_rim_m": [None if np.isnan(s) else float(s) for s in found.shift_m],
        "center_in_file_m": found.place_m.tolist(),
        "center_fitted_m": found.moved_m.tolist(),
        "not_told": UNDETERMINED,
    }
    extra = {**diagnosis.extra, "placement": moved}
    if not found.displaced:
        return replace(diagnosis, extra=extra)
    held = HeldOut(
        "readings and their reciprocal ones, a quarter of them at a time; over a model's accuracy of 5 %",
        diagnosis.held_out.noise_rms_v,
        found.misfit_before,
        found.misfit_after,
        diagnosis.held_out.p_value,
    )
    return replace(
        diagnosis,
        verdict=verdict_of(found.misfit_before, found.misfit_after, True, criteria),
        held_out=held,
        stage="electrodes",
        electrodes=tuple(sorted({*diagnosis.electrodes, *found.displaced})),
        depends_on=("electrode",),
        claims=(*(_displacement(found, e, criteria) for e in found.displaced), *diagnosis.claims),
        unexplained_ratio=found.misfit_after,
        reason=UNDETERMINED,
        extra=extra,
    )


def _displacement(found: Placement, electrode: int, criteria: Criteria) -> Claim:
    """One electrode out of place; where several are, the outline may have changed instead."""
    shift = found.moved_m[electrode] - found.place_m[electrode]
    error_m = float(np.hypot(OWN * found.error_m[electrode], FLOOR * found.radius_m))
    half = QUANTILE * error_m * np.abs(shift) / max(float(np.linalg.norm(shift)), 1e-12)
    effect = measured_as(Measured.PAD_SHIFT)()
    known = effect.known("along_m")
    along_m = float(np.clip(found.shift_m[electrode], known.low, known.high))
    moved_effect = effect.changed({"electrode": electrode, "along_m": along_m})
    estimates = {
        key: Estimate(float(value), float(value - error), float(value + error), "m")
        for key, value, error in zip(("dx_m", "dy_m"), shift, half, strict=True)
    }
    moved = confidence(float(found.shift_m[electrode]), float(found.error_m[electrode]), found.radius_m)
    sure = min(moved, criteria.surest_confidence)
    outline = (("outline_changed", sure),) if len(found.displaced) > 2 else ()
    return Claim(moved_effect, sure, found.misfit_before, estimates, outline)


def confidence(shift_m: float, error_m: float, radius_m: float) -> float:
    """Chance that an electrode is further from its place than hands leave it, given where the readings put it."""
    sigma_m = float(np.hypot(OWN * error_m, FLOOR * radius_m))
    return float(norm.cdf((abs(shift_m) - HANDS * radius_m) / sigma_m))

"""The piezoresistive law and its scatter from the specimen's cyclic compression test (paper II-C, Fig. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.piezo.polynomial import ORDER, PiezoPolynomial

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpecimenFit:
    """The fifth-order law, and what it averages away.

    ``hysteresis``: largest gap between the loading and the unloading curve over the law's whole fall of resistance
    (1; the paper reports 0.047), with its standard error; positive where loading reads the higher resistance.
    ``noise_fraction``: scatter about the branch curves as a fraction of the value. ``residual_fraction``: rms about the
    one law; with hysteresis it exceeds the noise. ``cycle_drift``: largest change of a cycle's mean ratio to the law.
    ``covariance`` (6,6) of the law's ``zero_ohm_sq`` times ``coefficients`` in ohm squared, by the noise alone.
    """

    law: PiezoPolynomial
    covariance: Array
    hysteresis: float
    hysteresis_standard_error: float
    noise_fraction: float
    residual_fraction: float
    cycle_drift: float


def fit_specimen(
    stress_pa: Array, sheet_resistance_ohm_sq: Array, time_s: Array, cycle: NDArray[np.integer]
) -> SpecimenFit:
    """Fit the law to a specimen test (all (N,)).

    Raises ``ValueError`` where the stresses can't fix a fifth-order polynomial.
    """
    order = np.argsort(time_s, kind="stable")
    stress = np.asarray(stress_pa, dtype=float)[order]
    resistance = np.asarray(sheet_resistance_ohm_sq, dtype=float)[order]
    law = PiezoPolynomial.fit(stress, resistance)
    ratio = resistance / law.sheet_resistance_ohm_sq(stress) - 1
    cycles = np.asarray(cycle)[order]
    drift = np.array([np.nanmean(ratio[cycles == number]) for number in np.unique(cycles)])
    width, error, noise = _hysteresis(stress, ratio, law)
    design = law.basis(stress) / law.sheet_resistance_ohm_sq(stress)[:, None]
    covariance = noise**2 * np.asarray(np.linalg.inv(design.T @ design))
    return SpecimenFit(
        law,
        covariance,
        width,
        error,
        noise,
        float(np.sqrt(np.nanmean(ratio**2))),
        float(np.ptp(drift)) if len(drift) > 1 else 0.0,
    )


def _hysteresis(stress: Array, ratio: Array, law: PiezoPolynomial) -> tuple[float, float, float]:
    """Width of the loop as a share of the law's fall, its standard error, and the relative noise about the branches.

    Half the branches' difference is fitted as stress times (largest - stress) times a cubic: a loop closes at its ends.
    """
    x = stress / law.max_stress_pa
    direction = np.sign(np.gradient(stress))
    powers = x[:, None] ** np.arange(ORDER + 1)
    loop = (direction * x * (1 - x))[:, None] * x[:, None] ** np.arange(4)
    design = np.hstack([powers, loop])
    good = np.isfinite(ratio)
    solution, *_ = np.linalg.lstsq(design[good], ratio[good], rcond=None)
    residual = ratio[good] - design[good] @ solution
    noise = float(np.sqrt((residual**2).sum() / max(1, good.sum() - design.shape[1])))
    covariance = noise**2 * np.linalg.pinv(design[good].T @ design[good])[ORDER + 1 :, ORDER + 1 :]
    level = np.linspace(0.0, 1.0, 201)
    resistance = law.sheet_resistance_ohm_sq(level * law.max_stress_pa)
    share = 2 * resistance / (resistance[0] - resistance[-1])
    row = (share * level * (1 - level))[:, None] * level[:, None] ** np.arange(4)
    gap = row @ solution[ORDER + 1 :]
    widest = int(np.argmax(np.abs(gap)))
    return float(gap[widest]), float(np.sqrt(row[widest] @ covariance @ row[widest])), noise

"""Presses that no fit has seen, predicted without and with what was named: the misfit before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, f

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.fit.full_scans import full_scans
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.judge.repeatability import Repeatability
from ertskin.diagnosis.linear.calibration_vector import SkinFamily
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.baseline import Baseline
from ertskin.diagnosis.search.chosen import Selection
from ertskin.diagnosis.search.trials import only_presses_show
from ertskin.physics.effects.effect import Effect
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

LONE_PRESS = 2.0
"""Misfit over noise from which a single held-out press is enough to say that something is missing."""
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Predictions:
    """Whitened residuals (n,P) over the noise, of the frames ``held`` (n,), by the uncorrected simulator and after.

    ``known_ratio``: misfit over noise after, less what the instrument's form errors are expected to make, where what
    isn't known of a field at presses that no fit has seen counts as noise; None without either.
    ``where_pressed_ratio``: misfit over noise after, where only what isn't known of fields that presses alone show
    counts so; None without such.
    """

    held: Indices
    before: Array
    after: Array
    known_ratio: float | None = None
    where_pressed_ratio: float | None = None

    @property
    def ratio_before(self) -> float:
        """Misfit over noise of the uncorrected simulator."""
        return ratio(self.before)

    @property
    def ratio_after(self) -> float:
        """Misfit over noise with what was named."""
        return ratio(self.after)

    def spoilt(self, criteria: Criteria) -> bool:
        """Whether what was named predicts worse than the uncorrected simulator."""
        return self.ratio_after > criteria.mismatch_ratio * self.ratio_before

    @property
    def ratio_judged(self) -> float:
        """The misfit that speaks against what was named."""
        return self.ratio_after if self.known_ratio is None else min(self.known_ratio, self.ratio_after)

    def left_against(self, effect: Effect, differ: Repeatability | None) -> float:
        """The misfit over noise that speaks against an effect's name.

        Against a field all speaks that its map predicts badly, though nobody could have known it there: it is no map of
        what is there. But what a field that presses alone show may be where nothing has pressed is no fault of one that
        rest shows. Where presses ``differ``, their scatter speaks only against names for what changes from place to
        place or from electrode to electrode.
        """
        if effect.hypothesis.field:
            if only_presses_show(effect) or self.where_pressed_ratio is None:
                return self.ratio_after
            return min(self.where_pressed_ratio, self.ratio_after)
        if differ is None or "where" in effect.hypothesis.kin:
            return self.ratio_judged
        return min(self.ratio_judged, differ.left_of(self.ratio_after))


def predictions(
    evidence: Evidence, baseline: Baseline, uncorrected: Solved, selection: Selection, family: SkinFamily, held: Indices
) -> Predictions:
    """Frames held out solved exactly: by ``uncorrected``, calibrated without any effect, and with what was named."""
    before = family.skin(uncorrected.calibration, ())
    after = family.remeshed(selection.after.calibration, selection.after.effects)
    return Predictions(
        held,
        _residual(evidence, before, baseline.linear_force_n, held),
        _residual(evidence, after, baseline.force_n, held),
    )


def _residual(evidence: Evidence, skin: Skin, force_n: Array, held: Indices) -> Array:
    scans = full_scans(skin, evidence.history, force_n, held)
    frames = evidence.frames(held)
    residual = frames.discounted((evidence.scan_v[held] - scans) / evidence.noise_v)
    # Directions that say nothing are noughts: over what is left, noise is to be one.
    return residual * frames.traces_factor[:, None]


def ratio(residual: Array) -> float:
    """Rms of a residual in units of the noise."""
    return float(np.sqrt((residual**2).mean()))


def broad_ratio(residual: Array, press: NDArray[np.int64]) -> float:
    """Misfit over noise without the worst press, unless that one is off by more than ``LONE_PRESS``.

    Discretisation and the unlimited pad of the model cost most at the corners, where a single held-out press may lie
    beyond what the others calibrate; a place that is really different is off by far more.
    """
    numbers = np.unique(press)
    ratios = np.array([ratio(residual[press == number]) for number in numbers])
    if len(numbers) < 3 or ratios.max() > LONE_PRESS:
        return ratio(residual)
    return ratio(residual[press != numbers[ratios.argmax()]])


def misfit_p(residual: Array, noise_error: float) -> float:
    """Chance of so large a misfit from white noise alone, its rms known to ``noise_error`` of itself: an F test."""
    if not noise_error:
        return float(chi2.sf(float((residual**2).sum()), residual.size))
    return float(f.sf(ratio(residual) ** 2, residual.size, 0.5 / noise_error**2))

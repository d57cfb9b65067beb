"""The forms compared: the diagnosis's own, those it was chosen from, and the baselines."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls
from specimen import Prediction, Rows, Specimen

from ertskin.diagnosis.coupon.compression import Compression
from ertskin.diagnosis.coupon.diagnosis import FORM, HELD, STARTS, held_by
from ertskin.diagnosis.coupon.fit import elastic_model, fit_coupon
from ertskin.hardware.measurement import Coupon
from ertskin.physics.effects.effect import FoamEffect, Strokes, parameter
from ertskin.physics.effects.exponential_memory import relaxing
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam

Array = NDArray[np.float64]

HYSTERESIS, SOFTENING, RELAXATION = FORM
TWO_TIMES = STARTS[RELAXATION.name][1]
TWIN = TWO_TIMES.effect
SHAPE = held_by([*(STARTS[e.name][0] for e in (HYSTERESIS, SOFTENING)), TWO_TIMES])
"""Parameters held where the relaxation has two times."""
POWERS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
CONSTRAINED_EFFECTS = (
    FoamSoftening(excess=0.1, kept=0.5, presses=1.0),
    FoamHysteresis(loss=0.05, reversal=0.2),
    ViscoelasticFoam(fraction=0.2, time_s=1.0, slow_fraction=0.1, slow_time_s=60.0, remembers_air=True),
)


@dataclass(frozen=True)
class LogTimeFoam(FoamEffect):
    """Fung's spectrum: the force relaxes by the same fraction in every decade from 0.03 to 1000 s."""

    name = "viscoelastic_foam"
    source = "Fung, Biomechanics (1981): quasi-linear viscoelasticity"
    order = 3

    fraction: float = parameter("1", 0.0, 5.0, 0.0, 0.05, "relaxing force over the relaxed force, per half decade")

    def reaction_n(self, force_n: Array, strokes: Strokes) -> Array:
        force = force_n.copy()
        for time_s in 10 ** np.arange(-1.5, 3.01, 0.5):
            force += self.fraction * relaxing(force_n, strokes.time_s, np.array([time_s]))
        return np.maximum(force, 0.0)


@dataclass(frozen=True)
class Form:
    """Effects to fit and the parameters of them that stay; ``as_recorded``: trust the gap's record as it is."""

    effects: tuple[FoamEffect, ...]
    held: frozenset[str] = HELD
    as_recorded: bool = False

    def __call__(self, specimens: list[Specimen], rows: list[Rows]) -> Prediction:
        """Fitted by the diagnosis's least squares."""
        model = fit_coupon([self._seen(s) for s in specimens], rows, self.effects, self.held)
        return lambda other: model.force_n(self._seen(other))

    def remembering(self, specimens: list[Specimen], rows: list[Rows]) -> Form:
        """With the effects' parameters set to their means over fits to every specimen by itself."""
        each = [fit_coupon([self._seen(s)], [r], self.effects, self.held) for s, r in zip(specimens, rows, strict=True)]
        means = [
            effect.changed({key: float(np.mean([getattr(m.effects[k], key) for m in each])) for key in effect.values()})
            for k, effect in enumerate(self.effects)
        ]
        return replace(
            self, effects=tuple(means), held=frozenset(f"{e.name}.{key}" for e in means for key in e.parameters())
        )

    def _seen(self, specimen: Specimen) -> Compression:
        return recorded(specimen.coupon, specimen.test) if self.as_recorded else specimen.test


FORCE_DRIVEN = replace(HYSTERESIS, driven_by="force")
OURS = "one relaxation, hysteresis, softening"
FORMS: dict[str, Form] = {
    OURS: Form((RELAXATION, HYSTERESIS, SOFTENING)),
    "the same, hysteresis driven by force": Form((RELAXATION, FORCE_DRIVEN, SOFTENING)),
    "the same, two relaxation times": Form((TWIN, HYSTERESIS, SOFTENING), SHAPE),
    "the same, relaxation even in log time": Form((LogTimeFoam(fraction=0.03), HYSTERESIS, SOFTENING), SHAPE),
    "the same, softening that ends abruptly": Form(
        (RELAXATION, HYSTERESIS, FoamSoftening(excess=0.3, kept=0.3, presses=0.7)),
        (HELD - SHAPE) | {"foam_softening.rejoin"},
    ),
    "the same, gap as recorded": Form((RELAXATION, HYSTERESIS, SOFTENING), as_recorded=True),
    "two relaxation times, softening": Form((TWIN, SOFTENING), SHAPE),
    "one relaxation, softening": Form((RELAXATION, SOFTENING)),
    "hysteresis, softening": Form((HYSTERESIS, SOFTENING), SHAPE),
    "one relaxation, hysteresis": Form((RELAXATION, HYSTERESIS)),
}


def recorded(coupon: Coupon, test: Compression) -> Compression:
    """The test with the gap held between its updates, as the record has it."""
    sink_m = coupon.height_m - np.asarray(coupon.gap_m, dtype=float)
    return replace(test, gap_time_s=np.asarray(coupon.time_s, dtype=float), gap_sink_m=sink_m)


def elastic_fit(specimens: list[Specimen], rows: list[Rows]) -> Prediction:
    """The elastic curve alone."""
    model = elastic_model([s.test for s in specimens], rows)
    return lambda other: model.force_n(other.test)


@dataclass(frozen=True)
class ConstrainedFit:
    """The plain constrained fit: powers of the strain with weights not negative, a two-term Prony series,
    force-driven hysteresis, softening of the first cycle; the load cell's zero as recorded, and the gap unless
    ``mended``."""

    mended: bool = False

    def __call__(self, specimens: list[Specimen], rows: list[Rows]) -> Prediction:
        """Fitted by least squares, the powers' weights solved for at every step."""
        keys = [(k, key) for k, e in enumerate(CONSTRAINED_EFFECTS) for key in e.parameters() if key != "rejoin"]
        known = [CONSTRAINED_EFFECTS[k].parameters()[key] for k, key in keys]
        force_n = np.concatenate([s.test.force_n[r] for s, r in zip(specimens, rows, strict=True)])

        def columns(x: Array, of: Specimen) -> Array:
            now = list(CONSTRAINED_EFFECTS)
            for (k, key), value in zip(keys, x, strict=True):
                now[k] = replace(now[k], **{key: float(value)})
            return self._powers(tuple(now), of)

        def fitted(x: Array) -> tuple[Array, Array]:
            stacked = np.concatenate([columns(x, s)[r] for s, r in zip(specimens, rows, strict=True)])
            weights = np.asarray(nnls(stacked, force_n)[0])
            return weights, stacked @ weights - force_n

        low, high = np.array([p.low for p in known]), np.array([p.high for p in known])
        start = np.clip([getattr(CONSTRAINED_EFFECTS[k], key) for k, key in keys], low + 1e-9, high - 1e-9)
        scale = [p.typical for p in known]
        found = least_squares(
            lambda x: fitted(x)[1], start, bounds=(low, high), x_scale=scale, diff_step=1e-3, max_nfev=60
        ).x
        weights = fitted(found)[0]
        return lambda other: np.asarray(columns(found, other) @ weights)

    def _powers(self, effects: tuple[FoamEffect, ...], of: Specimen) -> Array:
        """(N,P) force of every power of the strain after the effects."""
        test = of.test if self.mended else recorded(of.coupon, of.test)
        strokes, through = test.strokes(), []
        for power in POWERS:
            force = (strokes.sink_m / (0.6 * test.height_m)) ** power
            for effect in effects:
                force = effect.reaction_n(force, strokes)
            through.append(force)
        return np.stack(through, axis=1)

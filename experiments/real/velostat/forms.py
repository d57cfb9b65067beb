"""The forms compared: laws of the film, what it may remember, and a sensitivity for every place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from film import PRESSES, Film, Rows
from numba import njit
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from ertskin.physics.effects.effect import PiezoEffect, parameter
from ertskin.physics.effects.exponential_memory import relaxing
from ertskin.physics.effects.piezo_chain import felt
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis

Array = NDArray[np.float64]

AGREED_PA = 1e4
ORDER = 7
SMALLEST_PA = 100.0
"""Of the free law, where its logarithmic coordinate begins."""
SPREAD = 0.5
"""Standard deviation of a place's log sensitivity supposed beforehand."""
LADDER_S = 10.0 ** np.arange(-1.5, 2.1, 0.5)
"""Time constants of the memory whose signs are free, in second."""
GRID = 14
"""Thresholds of the Preisach model along one side."""
FEW = 60
"""Evaluations of the model in one fit, derivatives not counted."""
RENEWED_PA = 1000.0
"""Below it a change of pressure disturbs a contact in proportion to the change, above it to its share."""
OLD_S = 5.0
"""Age of the contacts when a recording begins."""
OUTLYING = 0.15
"""Relative error from which a reading counts in proportion: load cell and film are not read at the same moment."""
Prediction = Callable[[Film, Array], Array]
"""(N,) log resistance of a recording, from the log sensitivities (16,) of its places."""


@dataclass(frozen=True)
class AgeingContacts(PiezoEffect):
    """Contacts grow with the logarithm of the time since they were last disturbed, whichever way they were moved.

    Their age t follows t' = 1 - t |d ln(p + p0)/dt| / c, and the resistance falls by ``rate`` ln(1 + t/t0): Dieterich,
    J. Geophys. Res. 77 (1972) 3690; Ruina, J. Geophys. Res. 88 (1983) 10359.
    """

    name = "ageing_contacts"
    source = "Dieterich 1972; Ruina 1983"
    order = 3

    rate: float = parameter("1", 0.0, 1.0, 0.0, 0.05, "log resistance lost per factor e of age")
    change: float = parameter("1", 1e-3, 10.0, 0.3, 0.1, "change of log pressure that renews a contact", defining=False)
    shortest_s: float = parameter("s", 1e-3, 10.0, 0.05, 0.02, "age that counts as new", defining=False)

    def resistance_factor(
        self,
        pressure_pa: Array,
        position_m: Array,
        time_s: Array,
        extent_m: Array,
        wanted: NDArray[np.intp] | None = None,
    ) -> Array | float:
        step_s = np.diff(time_s, prepend=time_s[0])
        moved = np.abs(np.diff(np.log(pressure_pa + RENEWED_PA), axis=0, prepend=np.log(pressure_pa[:1] + RENEWED_PA)))
        age_s = _ages(moved / self.change, step_s)
        return np.asarray((1 + (age_s if wanted is None else age_s[wanted]) / self.shortest_s) ** -self.rate)

    def effective_pressure_pa(self, pressure_pa: Array, position_m: Array, time_s: Array, extent_m: Array) -> Array:
        return pressure_pa


@njit(cache=True)
def _ages(renewed, step_s):  # type: ignore[no-untyped-def]
    """(T,N) ages in second, exact for a steady change within each step."""
    age = np.empty(renewed.shape)
    age[0] = OLD_S
    for t in range(1, len(renewed)):
        for n in range(renewed.shape[1]):
            rate = renewed[t, n]
            kept = np.exp(-rate)
            age[t, n] = age[t - 1, n] * kept + step_s[t] * ((1 - kept) / rate if rate > 1e-9 else 1.0)
    return age


Starts = tuple[tuple[PiezoEffect, tuple[str, ...]], ...]
_LISTED = tuple((start.effect, start.free) for start in PiezoCreep.specimen_starts())
CREEPS: Starts = (*_LISTED, *((replace(e, remembers_air=False), k) for e, k in _LISTED if e.remembers_air))
"""The listed creep from all its starts, what a press leaves behind kept or not."""
LOG_CREEP: Starts = (
    (PiezoCreep(fraction=0.1, time_s=0.05, decades=4.0, remembers_air=True, multiplies=True), ("fraction", "half_pa")),
)
PLAYS: Starts = tuple((start.effect, start.free) for start in PiezoHysteresis.specimen_starts())
AGES: Starts = ((AgeingContacts(rate=0.05), ("rate", "change", "shortest_s")),)


@dataclass(frozen=True)
class Law:
    """Log resistance by the pressure felt (N,), from the law's own numbers."""

    start: tuple[float, ...]
    at: Callable[[Array, Array], Array]


def contact(x: Array, pressure_pa: Array) -> Array:
    """Contacts that conduct beside what the film conducts unpressed: G = G0 + a p^n.

    Holm's law for the conductance of a rough contact, n between 1/2 (elastic spots) and 1 (ever more of them:
    Greenwood and Williamson, Proc. R. Soc. A 295 (1966) 300).
    """
    return np.asarray(-np.logaddexp(x[0], x[1] + x[2] * np.log(np.maximum(pressure_pa, 1.0) / AGREED_PA)))


def exponential(x: Array, pressure_pa: Array) -> Array:
    """Tunnelling between grains that come closer: log R falls to a limit exponentially."""
    return np.asarray(x[0] - x[1] * -np.expm1(-np.maximum(pressure_pa, 0.0) / (AGREED_PA * np.exp(x[2]))))


CONTACT = Law((-6.8, -6.0, 1.0), contact)
TUNNEL = Law((6.8, 3.0, 1.0), exponential)


@dataclass(frozen=True)
class Form:
    """A law, effects that remember, and what differs from place to place: "sensitivity", "resistance" or nothing."""

    law: Law = CONTACT
    memory: tuple[Starts, ...] = ()
    places: str = ""

    def fit(self, films: Sequence[Film], rows: Sequence[Rows]) -> Fitted:
        """The best fit of all combinations of starts."""
        chains: list[Starts] = [()]
        for starts in self.memory:
            chains = [(*chain, start) for chain in chains for start in starts]
        fits = [self._from(chain, films, rows) for chain in chains]
        return min(fits, key=lambda one: one.cost)

    def _from(self, chain: Starts, films: Sequence[Film], rows: Sequence[Rows]) -> Fitted:
        known = [effect.parameters()[key] for effect, keys in chain for key in keys]
        laws, effects = len(self.law.start), len(known)
        places = PRESSES if self.places else 0
        start = np.array([*self.law.start, *(getattr(e, k) for e, keys in chain for k in keys), *np.zeros(places)])
        free = np.full(len(start), np.inf)
        low, high = -free, free.copy()
        low[laws : laws + effects], high[laws : laws + effects] = [k.low for k in known], [k.high for k in known]
        scale = np.r_[np.full(laws, 0.3), [k.typical for k in known], np.full(places, 0.2)]

        def cost(x: Array) -> Array:
            model, of_place = Fitted(self, chain, x), x[laws + effects :]
            wrong = [(model(f, of_place) - f.log_resistance)[r] for f, r in zip(films, rows, strict=True)]
            # A place's sensitivity is known beforehand as well as a hundredth of a reading would tell it.
            return np.concatenate([*wrong, 0.1 * of_place / SPREAD])

        fit = least_squares(
            cost, start, bounds=(low, high), x_scale=scale, loss="soft_l1", f_scale=OUTLYING, max_nfev=FEW
        )
        return Fitted(self, chain, fit.x, float(fit.cost))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A form with its numbers ``x``: the law's, the effects', the places'."""

    form: Form
    chain: Starts
    x: Array
    cost: float = 0.0

    @property
    def log_sensitivity(self) -> Array:
        """(16,) of the places, noughts where the form has none."""
        first = len(self.form.law.start) + sum(len(keys) for _, keys in self.chain)
        return self.x[first:] if self.form.places else np.zeros(PRESSES)

    @property
    def effects(self) -> list[PiezoEffect]:
        """The effects with the parameters found."""
        values = iter(map(float, self.x[len(self.form.law.start) :]))
        return [effect.changed({key: next(values) for key in keys}) for effect, keys in self.chain]

    def __call__(self, film: Film, log_sensitivity: Array) -> Array:
        """(N,) log resistance of a whole recording."""
        of_press = log_sensitivity[film.press] if self.form.places else np.zeros(len(film.press))
        stress = film.stress_pa * (np.exp(of_press) if self.form.places == "sensitivity" else 1.0)
        pressure, factor = felt(self.effects, stress[:, None], np.zeros((1, 2)), film.time_s, np.zeros((2, 2)))
        law = self.form.law.at(self.x, pressure[:, 0]) + np.log(np.ravel(factor))
        return np.asarray(law - (of_press if self.form.places == "resistance" else 0.0))


@dataclass(frozen=True)
class FreeLaw:
    """Any static law: its logarithm a polynomial in the pressure's, or the resistance one in the pressure itself.

    With a ``ladder`` of time constants a linear memory of that logarithm besides, whose signs are free: whatever
    fades, creep or recovery, at any speed.
    """

    order: int = ORDER
    logarithmic: bool = True
    ladder: bool = False

    def fit(self, films: Sequence[Film], rows: Sequence[Rows]) -> Prediction:
        """Linear least squares."""
        top = max(float(film.stress_pa[r].max()) for film, r in zip(films, rows, strict=True))

        def coordinate(stress_pa: Array) -> Array:
            inside = np.clip(stress_pa, 0.0, top)
            if self.logarithmic:
                return np.asarray(2 * np.log1p(inside / SMALLEST_PA) / np.log1p(top / SMALLEST_PA) - 1)
            return 2 * inside / top - 1

        def columns(film: Film) -> Array:
            x = coordinate(film.stress_pa)
            design = chebyshev.chebvander(x, self.order)
            if not self.ladder:
                return design
            past = [relaxing(x, film.time_s, np.array([tau])) for tau in LADDER_S]
            # A law's logarithm and its own past, and what the past is worth under load and in the air.
            return np.column_stack([design, *past, *(p * (x > -0.9) for p in past)])

        design = np.concatenate([columns(f)[r] for f, r in zip(films, rows, strict=True)])
        value = np.concatenate([f.log_resistance[r] for f, r in zip(films, rows, strict=True)])
        if self.logarithmic:
            weights = np.linalg.lstsq(design, value, rcond=1e-9)[0]
            return lambda film, _: columns(film) @ weights
        weights = np.linalg.lstsq(design / np.exp(value)[:, None], np.ones(len(value)), rcond=1e-9)[0]
        return lambda film, _: np.log(np.maximum(columns(film) @ weights, 1e-3))


@dataclass(frozen=True)
class Preisach:
    """Conductance as a sum of relays that switch on above one pressure and off below another, all weights free.

    Mayergoyz, Phys. Rev. Lett. 56 (1986) 1518. The relays on the diagonal are a static law of any shape.
    """

    def fit(self, films: Sequence[Film], rows: Sequence[Rows]) -> Prediction:
        """Least squares of the relative error with weights that are not negative."""
        top = max(float(film.stress_pa[r].max()) for film, r in zip(films, rows, strict=True))
        levels = top * np.geomspace(0.01, 0.98, GRID)

        def columns(film: Film) -> Array:
            relays = [_relay(film.stress_pa, up, down) for i, up in enumerate(levels) for down in levels[: i + 1]]
            return np.column_stack([np.ones(len(film.stress_pa)), *relays])

        design = np.concatenate([columns(f)[r] for f, r in zip(films, rows, strict=True)])
        conductance = np.concatenate([1 / f.resistance[r] for f, r in zip(films, rows, strict=True)])
        weights = nnls(design / conductance[:, None], np.ones(len(conductance)), maxiter=20 * design.shape[1])[0]
        return lambda film, _: -np.log(np.maximum(columns(film) @ weights, 1e-6))


def _relay(stress_pa: Array, up_pa: float, down_pa: float) -> Array:
    """(N,) 1 from where the stress passes ``up_pa`` until it falls below ``down_pa``."""
    change = np.where(stress_pa >= up_pa, 1, np.where(stress_pa < down_pa, -1, 0))
    last = np.maximum.accumulate(np.where(change != 0, np.arange(len(change)), 0))
    return np.asarray(change[last] > 0, dtype=float)

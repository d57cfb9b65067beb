"""The resting skin followed: contact and sheet resistances from rest frames as they come (Kalman 1960).

Resistances are homogeneous of degree one in those of the sheet and the contacts: a rest frame is, closely,

    rest + slope (relative change of contacts and sheet) + what these don't explain + noise.

The first wander as random walks, each at its own rate; a contact that jitters is another one in every scan besides.
What they don't explain lies outside the slopes' span and wanders too, slower than the noise. A press changes the sheet,
so its reading scales with the sheet's resistance (``gain``); contacts are in series with it, and doubling one moves the
response to a press by a thousandth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HOUR_S = 3600.0
LEAST_CONTACT_RATE, LEAST_SHEET_RATE = 0.05 / HOUR_S**0.5, 0.01 / HOUR_S**0.5
"""Share of its value that a contact and the sheet may change by, times the square root of the seconds, however quiet
the calibration was: stitched contacts, and a fabric of -0.6 % a kelvin in a room that warms."""
LEAST_WANDER = 0.3 / HOUR_S**0.5
"""The same of what they don't explain, in units of the noise."""
FIRST_CONTACT, FIRST_SHEET, FIRST_WANDER = 1.0, 0.3, 100.0
"""What may have changed since the calibration, in the same units."""
NEGLIGIBLE = 1e-6
"""Slopes below this share of the largest tell nothing."""
FALSE_ALARMS = 1e-3
"""Share of frames of the skin as it was calibrated, resting or touched, that are said to be of another one."""
FEWEST = 4
"""Rest frames from which rates are estimated."""


@dataclass(frozen=True, eq=False)
class RestingSkin:
    """The untouched skin at its calibration, in n whitened coordinates, and how it wanders.

    ``rest_v`` (n,). ``slope_v`` (n,m) by relative change of the contacts and, last, the sheet; m = 0 where nothing is
    known of them. ``noise_v`` of a coordinate in one frame. ``contact_rate``, ``sheet_rate`` (1/sqrt(s)), ``wander``
    (of what these don't explain, in units of the noise, 1/sqrt(s)). ``jitter``: relative change of contacts from
    scan to scan. ``limit``: mean square of a rest frame's surprise that one in a thousand exceeds.
    """

    rest_v: Array
    slope_v: Array
    noise_v: float
    contact_rate: float = LEAST_CONTACT_RATE
    sheet_rate: float = LEAST_SHEET_RATE
    wander: float = LEAST_WANDER
    jitter: float = 0.0
    limit: float = np.inf

    @cached_property
    def span(self) -> Array:
        """(n,r) orthonormal basis of what contacts and sheet explain."""
        left, size, _ = np.linalg.svd(self.slope_v, full_matrices=False)
        return np.ascontiguousarray(left[:, size > NEGLIGIBLE * size.max(initial=0.0)])

    @cached_property
    def information(self) -> Array:
        """(m,m) what a frame tells of contacts and sheet: slope'slope over the noise's square."""
        return np.asarray(self.slope_v.T @ self.slope_v / self.noise_v**2)

    @classmethod
    def learned(cls, rest_v: Array, time_s: Array, slope_v: Array, noise_v: float) -> RestingSkin:
        """From rest frames (T,n) of a calibration in order of time: rates of the largest likelihood, above the least.

        With fewer than ``FEWEST`` frames the least rates are taken.
        """
        # Live scans need neither: both load for longer than all the rest.
        from scipy.optimize import minimize
        from scipy.stats import chi2

        least = float(chi2.isf(FALSE_ALARMS, rest_v.shape[1]) / rest_v.shape[1])
        skin = cls(rest_v.mean(axis=0), slope_v, noise_v, limit=least)
        if len(rest_v) < FEWEST:
            return skin

        def rated(logs: Array) -> RestingSkin:
            contact, sheet, wander, jitter = np.exp(logs)
            return replace(skin, contact_rate=contact, sheet_rate=sheet, wander=wander, jitter=jitter)

        def cost(logs: Array) -> float:
            return -sum(step[1] for step in surprises(rated(logs), rest_v, time_s))

        start = np.log([skin.contact_rate, skin.sheet_rate, skin.wander, 1e-2])
        found = np.exp(minimize(cost, start, method="Nelder-Mead", options={"maxfev": 400, "fatol": 0.1}).x)
        slowest = LEAST_CONTACT_RATE, LEAST_SHEET_RATE, LEAST_WANDER, 0.0
        contact, sheet, wander, jitter = (max(float(a), b) for a, b in zip(found, slowest, strict=True))
        skin = replace(skin, contact_rate=contact, sheet_rate=sheet, wander=wander, jitter=jitter)
        seen = np.array([step[0] for step in surprises(skin, rest_v, time_s)])
        return replace(skin, limit=max(least, _scaled_limit(seen)))

    @property
    def rates(self) -> Array:
        """(m,) of contacts and sheet."""
        rates = np.full(self.slope_v.shape[1], self.contact_rate)
        rates[-1:] = self.sheet_rate
        return rates

    @cached_property
    def wandering(self) -> Array:
        """(m,m) by how much the covariance of contacts and sheet grows in a second."""
        return np.diag(self.rates**2)

    @property
    def jitters(self) -> Array:
        """(m,) relative change from scan to scan."""
        jitters = np.full(self.slope_v.shape[1], self.jitter)
        jitters[-1:] = 0.0
        return jitters


@dataclass(frozen=True, eq=False)
class RestState:
    """What is known of the resting skin at ``time_s``: relative ``change`` (m,) of contacts and sheet with
    ``covariance`` (m,m), ``remainder_v`` (n,) they don't explain, and its variance in units of the noise's."""

    skin: RestingSkin
    time_s: float
    change: Array
    covariance: Array
    remainder_v: Array
    remainder_variance: float

    @classmethod
    def unknown(cls, skin: RestingSkin, time_s: float) -> RestState:
        """Before any rest frame: anything may have happened since the calibration."""
        size = np.full(skin.slope_v.shape[1], FIRST_CONTACT)
        size[-1:] = FIRST_SHEET
        return cls(skin, time_s, np.zeros(len(size)), np.diag(size**2), np.zeros(len(skin.rest_v)), FIRST_WANDER**2)

    @cached_property
    def zero_v(self) -> Array:
        """(n,) what the untouched skin reads."""
        return np.asarray(self.skin.rest_v + self.skin.slope_v @ self.change + self.remainder_v)

    @property
    def gain(self) -> float:
        """Sheet resistance over that of the calibration, which a press's change of the readings scales with."""
        return float(1.0 + self.change[-1:].sum())

    @property
    def zero_variance(self) -> float:
        """Mean variance of ``zero_v``'s coordinates, in units of the noise's."""
        known = self.skin.span.shape[1]
        explained = float(np.sum(self.skin.information * self.covariance))
        return (explained + (len(self.skin.rest_v) - known) * self.remainder_variance) / len(self.skin.rest_v)

    def at(self, time_s: float) -> RestState:
        """The same, as sure as it is when that much time has gone by."""
        gone = max(0.0, time_s - self.time_s)
        covariance = self.covariance + gone * self.skin.wandering
        variance = self.remainder_variance + gone * self.skin.wander**2
        return replace(self, time_s=time_s, covariance=covariance, remainder_variance=variance)

    def loosened(self) -> RestState:
        """The same, contacts and sheet anything they may be: for a skin that has drifted faster than it ever did."""
        return replace(self, covariance=RestState.unknown(self.skin, self.time_s).covariance)

    def surprise(self, coordinates_v: Array) -> float:
        """Mean square of what a rest frame (n,) at this time shows against what is expected, about 1."""
        return self._square(coordinates_v)[0] / len(coordinates_v)

    def unexplained(self, coordinates_v: Array) -> float:
        """What neither contacts nor sheet explain of ``surprise``, which is never less: known at once, and of nearly
        every touch far more than a resting skin shows."""
        error = (coordinates_v - self.zero_v) / self.skin.noise_v
        within = error @ self.skin.span
        return float(error @ error - within @ within) / (1.0 + self.remainder_variance) / len(error)

    def likely(self, coordinates_v: Array) -> tuple[float, float]:
        """``surprise`` of a rest frame (n,) at this time, and its log likelihood."""
        square, mixed = self._square(coordinates_v)
        free = len(coordinates_v) - self.skin.span.shape[1]
        logarithm = float(np.linalg.slogdet(mixed)[1]) + free * np.log(1.0 + self.remainder_variance)
        return square / len(coordinates_v), -0.5 * (square + logarithm)

    def _square(self, coordinates_v: Array) -> tuple[float, Array]:
        """What is left of a rest frame (n,), squared; (m,m) by how much more than the noise it may wander."""
        skin = self.skin
        error = (coordinates_v - self.zero_v) / skin.noise_v
        within, outside = self._parted(error)
        seen = skin.slope_v.T @ error / skin.noise_v
        spread = self.covariance + np.diag(skin.jitters**2)
        mixed = np.eye(len(spread)) + skin.information @ spread
        square = float(within @ within - seen @ spread @ np.linalg.solve(mixed, seen))
        return square + float(outside @ outside) / (1.0 + self.remainder_variance), mixed

    def updated(self, coordinates_v: Array) -> RestState:
        """After a rest frame (n,) at this time."""
        skin = self.skin
        error = (coordinates_v - self.zero_v) / skin.noise_v
        _, outside = self._parted(error)
        spread = self.covariance + np.diag(skin.jitters**2)
        gained = np.linalg.solve((np.eye(len(spread)) + skin.information @ spread).T, self.covariance).T
        covariance = self.covariance - gained @ skin.information @ self.covariance
        share = self.remainder_variance / (1.0 + self.remainder_variance)
        return replace(
            self,
            change=self.change + gained @ (skin.slope_v.T @ error / skin.noise_v),
            covariance=0.5 * (covariance + covariance.T),
            remainder_v=self.remainder_v + share * skin.noise_v * outside,
            remainder_variance=share,
        )

    def _parted(self, error: Array) -> tuple[Array, Array]:
        """(r,) what contacts and sheet could explain, (n,) the rest."""
        within = self.skin.span.T @ error
        return within, error - self.skin.span @ within


def followed(skin: RestingSkin, rest_v: Array, rest_s: Array, time_s: Array) -> list[RestState]:
    """The resting skin at each of ``time_s`` (N,) from rest frames (T,n) before and after, in order of time
    (Rauch, Tung & Striebel, AIAA J. 3 (1965) 1445); straight between them, as the mean of a random walk is.

    Raises ``ValueError`` where there is no rest frame.
    """
    if not len(rest_v):
        raise ValueError("no rest frame to follow")
    ahead, state = [], RestState.unknown(skin, float(rest_s[0]))
    for frame, time in zip(rest_v, rest_s, strict=True):
        state = state.at(float(time)).updated(frame)
        ahead.append(state)
    smooth = ahead[-1:]
    for before in reversed(ahead[:-1]):
        smooth.insert(0, _smoothed(before, smooth[0]))
    return [_between(smooth, rest_s, float(time)) for time in time_s]


def _smoothed(before: RestState, after: RestState) -> RestState:
    """A filtered state with what the later, smoothed one adds."""
    guess = before.at(after.time_s)
    back = np.linalg.solve(guess.covariance, before.covariance).T
    covariance = before.covariance + back @ (after.covariance - guess.covariance) @ back.T
    share = before.remainder_variance / guess.remainder_variance
    return replace(
        before,
        change=before.change + back @ (after.change - before.change),
        covariance=covariance,
        remainder_v=before.remainder_v + share * (after.remainder_v - before.remainder_v),
        remainder_variance=before.remainder_variance + share**2 * (after.remainder_variance - guess.remainder_variance),
    )


def _between(states: list[RestState], rest_s: Array, time_s: float) -> RestState:
    after = int(np.searchsorted(rest_s, time_s))
    if after == 0 or after == len(states):
        return states[min(after, len(states) - 1)]
    before, later = states[after - 1], states[after]
    share = (time_s - before.time_s) / (later.time_s - before.time_s)
    return replace(
        before,
        time_s=time_s,
        change=(1.0 - share) * before.change + share * later.change,
        covariance=(1.0 - share) * before.covariance + share * later.covariance,
        remainder_v=(1.0 - share) * before.remainder_v + share * later.remainder_v,
        remainder_variance=(1.0 - share) * before.remainder_variance + share * later.remainder_variance,
    )


def surprises(skin: RestingSkin, rest_v: Array, time_s: Array) -> list[tuple[float, float]]:
    """Of each rest frame but the first, from those before it."""
    state, found = RestState.unknown(skin, float(time_s[0])).updated(rest_v[0]), []
    for frame, time in zip(rest_v[1:], time_s[1:], strict=True):
        state = state.at(float(time))
        found.append(state.likely(frame))
        state = state.updated(frame)
    return found


def _scaled_limit(seen: Array) -> float:
    """What one in a thousand exceeds of scores that are a scaled chi-square (Satterthwaite, Biometrics 2 (1946))."""
    from scipy.stats import gamma

    mean, variance = float(seen.mean()), float(seen.var(ddof=1))
    return float(gamma.isf(FALSE_ALARMS, mean**2 / variance, scale=variance / mean))

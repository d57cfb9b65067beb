"""Materials that remember: spectra of relaxation times, smooth and relay loops, contacts that age.

Kernels without a finite number of modes (stretched, fractional, logarithmic) are carried by modes spaced evenly in the
logarithm of time, fitted with non-negative weights (Emri and Tschoegl, Rheol. Acta 32, 1993).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.special import exp1

Array = NDArray[np.float64]


def stretched(t: Array, tau_s: float, beta: float) -> Array:
    """Kohlrausch's growth 1 - exp(-(t/tau)^beta) (Ann. Phys. 167, 1854; Williams and Watts 1970)."""
    return np.asarray(-np.expm1(-((t / tau_s) ** beta)))


def fractional(t: Array, tau_s: float, beta: float) -> Array:
    """Growth of a fractional Zener body, 1 - E_beta(-(t/tau)^beta), by its spectrum (Gorenflo and Mainardi, 1997)."""
    x = np.linspace(-34.0, 34.0, 2001)
    r = np.exp(x)
    density = np.sin(np.pi * beta) / np.pi * r**beta / (r ** (2 * beta) + 2 * r**beta * np.cos(np.pi * beta) + 1.0)
    left = np.exp(-np.outer(t / tau_s, r)) @ density * (x[1] - x[0])
    return np.asarray(1.0 - left)


def quasilinear(t: Array, fast_s: float, slow_s: float) -> Array:
    """Fung's relaxation with a flat spectrum from ``fast_s`` to ``slow_s`` (Biomechanics, 1981, section 7.6)."""
    safe = np.maximum(t, 1e-9 * fast_s)
    left = (exp1(safe / slow_s) - exp1(safe / fast_s)) / np.log(slow_s / fast_s)
    return np.asarray(np.where(t > 0, 1.0 - left, 0.0))


def modes(growth: Callable[[Array], Array], fast_s: float = 0.02, slow_s: float = 2e4) -> tuple[Array, Array]:
    """Times (s) and weights of exponentials whose sum grows as ``growth``; a weight at time 0 is an instant part."""
    times = np.geomspace(fast_s, slow_s, 13)
    t = np.concatenate([[0.0], np.geomspace(0.2 * fast_s, slow_s, 240)])
    design = np.column_stack([-np.expm1(-t[:, None] / times), t > 0])
    weights, _ = nnls(design, growth(t))
    kept = weights[:-1] > 1e-9
    return np.append(times[kept], 1e-9), np.append(weights[:-1][kept], weights[-1])


class Spectrum:
    """Delayed answer of many places to their inputs: sum of modes, each on its own way to the input."""

    def __init__(self, growth: Callable[[Array], Array], points: int) -> None:
        self.time_s, self.weight = modes(growth)
        self.state = np.zeros((len(self.time_s), points))
        self.last = np.zeros(points)

    def advance(self, value: Array, since_s: float) -> Array:
        """The delayed part of an input that has gone in a straight line to ``value`` within ``since_s``."""
        if since_s > 0:
            ratio = since_s / self.time_s
            decay = np.exp(-np.minimum(ratio, 700.0))
            ramp = (1.0 - decay) / ratio
            self.state *= decay[:, None]
            self.state += (1.0 - ramp)[:, None] * value + (ramp - decay)[:, None] * self.last
        self.last = value.copy()
        return np.asarray(self.weight @ self.state)


class ColemanHodgdon:
    """Rate-independent lag y of x: dy = a |dx| (x - y) + g dx (Coleman and Hodgdon, Int. J. Eng. Sci. 24, 1986)."""

    def __init__(self, scale: float, follow: float, points: int) -> None:
        self.scale, self.follow = scale, follow
        self.last, self.behind = np.zeros(points), np.zeros(points)

    def advance(self, value: Array) -> Array:
        """y after x went straight to ``value``; exact for a straight way, however long."""
        way = value - self.last
        settled = -np.sign(way) * self.scale * (1.0 - self.follow)
        self.behind = settled + (self.behind - settled) * np.exp(-np.abs(way) / self.scale)
        self.last = value.copy()
        return np.asarray(value + self.behind)


class AdheringContacts:
    """A Preisach plane whose contacts close at a pressure a and open at q a (Mayergoyz, Phys. Rev. Lett. 56, 1986).

    Adhesion holds in proportion to what pressed a contact shut (Fuller and Tabor, Proc. R. Soc. A 345, 1975). Closing
    pressures are spread so that the first rise is x itself; q has a triangular density on [low, 1]. The relays of one q
    are shut up to a front, so the front is all their memory.
    """

    SHARES = 5

    def __init__(self, low: float, points: int) -> None:
        middle = (np.arange(self.SHARES) + 0.5) / self.SHARES
        self.q = low + (1.0 - low) * (1.0 - np.sqrt(1.0 - middle))
        self.front = np.zeros((self.SHARES, points))

    def advance(self, value: Array) -> Array:
        """Weight of the contacts shut after x went straight to ``value``."""
        self.front = np.maximum(value, np.minimum(self.front, value / self.q[:, None]))
        return np.asarray(self.front.mean(axis=0))


class Ageing:
    """Time of contact of places under load: it runs while pressed, shrinks as the load changes, is lost in air.

    Dieterich's and Ruina's ageing of rock friction (J. Geophys. Res. 77, 1972; 88, 1983), load in place of slip.
    """

    def __init__(self, least: float, lost_s: float, points: int) -> None:
        self.least, self.lost_s = least, lost_s
        self.last, self.age_s = np.zeros(points), np.zeros(points)

    def advance(self, value: Array, since_s: float) -> Array:
        """Age (s) after the load went to ``value`` within ``since_s``."""
        change = np.abs(value - self.last) / (np.maximum(value, self.last) + self.least)
        self.age_s *= np.exp(-change)
        held = value > self.least
        self.age_s = np.where(held, self.age_s + since_s, self.age_s * np.exp(-since_s / self.lost_s))
        self.last = value.copy()
        return self.age_s

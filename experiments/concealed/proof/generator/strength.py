"""How large an effect is against the noise once the calibration has taken what it can, and the size for a ratio wanted.

Measured on the skin's own plan, with its steps, times and all that foam and fabric remember: the difference of two
simulations. Force in every frame, less what one stiffness explains. Readings in a few frames of a few presses, on a
coarser mesh, less what contact resistances (a diagonal added to the transfer matrix), the sheet's resistance and the
law's scale at three powers of the force explain by least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from .effect import Effect
from .mesh import Fineness
from .protocol import Plan
from .recording import Clean, clean
from .sheet import Sheet
from .simulate import HOLD, LOADING, REST, UNLOADING, Frames, frames_of
from .skin import Skin

Array = NDArray[np.float64]
PRESSES = 5
COARSE = Fineness(3.6e-3, 9e-4, 1.2e-4)


@dataclass(frozen=True)
class Ratio:
    """rms over the noise's, noise included: in what a resistor network could give, in the other readings, in force."""

    reciprocal: float
    rest: float
    force: float

    @property
    def own(self) -> float:
        """The largest: what a diagnosis has to go by."""
        return max(self.reciprocal, self.rest, self.force)


class Ruler:
    """Measures effects on one skin."""

    def __init__(self, skin: Skin) -> None:
        self.skin = replace(skin, fineness=COARSE)
        self.sheet = Sheet(skin.outline_m, skin.electrodes, COARSE)
        self.chosen = _chosen(skin.plan, frames_of(skin))
        self.without = clean(self.skin, [], self.sheet, self.chosen)
        protocol = skin.protocol
        kept = np.ones(protocol.weights.shape[:2], bool) if protocol.measured is None else protocol.measured
        self.kept = kept.ravel()
        i, j = np.triu_indices(protocol.electrodes, 1)
        current, weight = protocol.current, protocol.weights
        design = (weight[:, :, i] * current[:, None, j] + weight[:, :, j] * current[:, None, i]).reshape(-1, len(i))
        left, size, _ = np.linalg.svd(design[self.kept], full_matrices=False)
        self.basis = left[:, size > 1e-9 * size[0]]

    def _nuisance(self) -> Array:
        """(frames chosen, readings, n) what a calibration can change."""
        protocol, found = self.skin.protocol, self.without
        count = len(found.voltage_v)
        contact = [protocol.readings(np.diag(row)).ravel()[self.kept] for row in np.eye(protocol.electrodes)]
        fixed = np.broadcast_to(np.stack(contact, axis=1), (count, self.kept.sum(), protocol.electrodes))
        flat = found.voltage_v.reshape(count, -1)[:, self.kept]
        change = flat - flat[0]
        force = found.force_n[self.chosen].sum(axis=1)
        load = (force / force.max())[:, None]
        return np.concatenate([fixed, np.stack([flat, change, change * load, change * load**2], axis=2)], axis=2)

    def ratio(self, effects: Sequence[Effect]) -> Ratio:
        """What ``effects`` leave after calibration."""
        noise, found = self.skin.noise, clean(self.skin, effects, self.sheet, self.chosen)
        voltage = self._recorded(effects, found)
        step = (voltage - self.without.voltage_v).reshape(len(voltage), -1)[:, self.kept]
        inside, nuisance = step @ self.basis, self._nuisance()
        taken = np.einsum("rp,trn->tpn", self.basis, nuisance, optimize=True).reshape(inside.size, -1)
        # A contact that no reading was taken through has nothing to take.
        size = np.linalg.norm(taken, axis=0)
        taken = taken[:, size > 1e-12 * size.max()] / size[size > 1e-12 * size.max()]
        left = inside.ravel() - taken @ np.linalg.lstsq(taken, inside.ravel(), rcond=1e-10)[0]
        outside = step - inside @ self.basis.T
        beyond = max(outside.shape[1] - self.basis.shape[1], 1) * len(outside)
        return Ratio(
            _over(np.sum(left**2) / left.size, noise.white_v),
            _over(np.sum(outside**2) / beyond, noise.white_v),
            _over(self._force(found), noise.force_n),
        )

    def _recorded(self, effects: Sequence[Effect], found: Clean) -> Array:
        """(frames chosen, K, M) readings after what scans bear on one another."""
        rng = np.random.default_rng([self.skin.seed, 11])
        moving = ~np.isin(found.frames.phase, (REST, HOLD))
        # Levels are evenly spaced, so a frame that wasn't solved lies about straight between those that were.
        voltage = make_interp_spline(self.chosen, found.voltage_v, k=1)(np.arange(len(moving)))
        for effect in effects:
            voltage = effect.recorded(voltage, moving, rng)
        return voltage[self.chosen]

    def _force(self, found: Clean) -> float:
        """Mean square of the force that one stiffness can't make up for."""
        true, linear = found.force_n.ravel(), self.without.force_n.ravel()
        pressed = linear > 0
        scale = float(true @ linear / (linear @ linear))
        return float(np.mean((true[pressed] - scale * linear[pressed]) ** 2))

    def size(self, make: Callable[[float], Effect], wanted: float) -> tuple[float, Ratio]:
        """Size (four digits) at which ``make(size)`` has the own ratio wanted, and the ratio reached."""
        largest = make(0.0).largest
        goal = np.log(wanted**2 - 1.0)
        tried: list[tuple[float, float, Ratio]] = []
        size = 0.08 * largest
        for _ in range(6):
            size = float(f"{min(max(size, 1e-5 * largest), largest):.4g}")
            ratio = self.ratio([make(size)])
            tried.append((np.log(size), np.log(max(ratio.own**2 - 1.0, 1e-12)), ratio))
            if abs(tried[-1][1] - goal) < 0.12 or (size >= largest and tried[-1][1] < goal):
                break
            size = float(np.exp(_next(tried, goal)))
        best = min(tried, key=lambda one: abs(one[1] - goal))
        return float(f"{np.exp(best[0]):.4g}"), best[2]


def _next(tried: list[tuple[float, float, Ratio]], goal: float) -> float:
    """Secant in logarithms, squares at first, at most e^2.5 at a time, between sizes that enclose the goal."""
    x, y, _ = tried[-1]
    slope = 2.0
    if len(tried) > 1 and abs(x - tried[-2][0]) > 1e-6:
        slope = float(np.clip((y - tried[-2][1]) / (x - tried[-2][0]), 0.5, 8.0))
    guess = x + float(np.clip((goal - y) / slope, -2.5, 2.5))
    below = max((a for a, b, _ in tried if b < goal), default=-np.inf)
    above = min((a for a, b, _ in tried if b > goal), default=np.inf)
    return guess if below < guess < above else 0.5 * (below + above) if np.isfinite(below + above) else guess


def _over(mean_square: float, noise: float) -> float:
    return float(np.sqrt(1.0 + mean_square / noise**2))


def _chosen(plan: Plan, frames: Frames) -> list[int]:
    """Numbers of the frames to solve: of each press chosen the rest before it, half in, deepest, last hold, half out.

    And the rest at the end.
    """
    found = {0, len(frames.time_s) - 1}
    for number in _presses(plan):
        at = np.flatnonzero(frames.press == number)
        way_in, held, way_out = (at[frames.phase[at] == phase] for phase in (LOADING, HOLD, UNLOADING))
        # A press of one level has no way out, one that isn't held no hold.
        half_out = way_out[len(way_out) // 2 :][:1]
        found |= {int(i) for i in (at[0], way_in[(len(way_in) - 1) // 2], way_in[-1], *held[-1:], *half_out)}
    return sorted(found)


def _presses(plan: Plan) -> list[int]:
    """Numbers of a few presses all through the plan; places pressed twice first."""
    count = len(plan.presses)
    if count <= PRESSES:
        return list(range(count))
    place = [tuple(p.position_m[0]) for p in plan.presses]
    again = next((i for i in range(count) if place[i] in place[:i]), None)
    chosen = set(np.linspace(0, count - 1, PRESSES - (2 if again else 0)).astype(int).tolist())
    if again is not None:
        chosen |= {again, place.index(place[again])}
    return sorted(chosen)

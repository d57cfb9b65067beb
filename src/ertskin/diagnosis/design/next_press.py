"""The press that would tell rival explanations apart: a T-optimal design.

Atkinson and Fedorov (Biometrika 62 (1975) 57): of all experiments that can be done, the one whose outcome the fitted
model and its rival predict most differently, what refitting could absorb taken off. Here refitting is linear and
Gaussian: every direction a calibration or an effect's own parameters could move the readings counts only beyond what
they are known to. The design is found by exchanging one of its coordinates at a time (Meyer and Nachtsheim,
Technometrics 37 (1995) 60).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.linear.sheet_state import displaced
from ertskin.hardware.plan import Plan, plan_from_presses
from ertskin.physics.conduction.mesh import Grading
from ertskin.physics.conduction.sheet import Resolution, SheetModel
from ertskin.physics.effects.effect import Effect, ElectrodeEffect, FoamEffect, MotionEffect
from ertskin.physics.history import History, Phase
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import Skin

Array = NDArray[np.float64]

COARSE = Resolution(2, Grading(cell_m=8e-3, rim_m=5e-4, growth=7.0, spread=0.7))
"""Mesh for the predictions: what tells rivals apart need not be known to a percent."""
NOTHING = 3.0
"""Half chi-square below which a press tells nothing: odds of 20 to 1 at best."""
NEARLY = 0.8
"""A shorter press is preferred if it tells this part of what the best one does."""
FEW = 4
"""Frames of a ramp or a hold that are predicted; each stands for those between."""
ROUNDS = 2
PLACES = 12
LAW_ERROR, PAD_ERROR = 0.02, 0.02
"""Relative standard deviations that refitting may use up: law of the fabric, pad under the indenter."""
PLACE_ERROR_M = 1e-4
KNOWN = 0.2
"""Relative standard deviation to which the parameters of an effect are taken to be fitted."""


@dataclass(frozen=True)
class Design:
    """One press: ``cycles`` times down at a speed, held, and up again."""

    position_m: tuple[float, float]
    depth_m: float
    hold_s: float
    speed_m_per_s: float
    cycles: int

    def as_builtins(self) -> dict[str, Any]:
        """As ``diagnosis.json`` and ``ertskin record plan=...`` have it."""
        return asdict(self) | {"position_m": list(self.position_m)}

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return self.cycles * (self.hold_s + 2 * self.depth_m / self.speed_m_per_s)


@dataclass(frozen=True)
class Feasible:
    """What the rig can do: choices for every coordinate of a design; the first of each is the reference press."""

    position_m: tuple[tuple[float, float], ...]
    depth_m: tuple[float, ...]
    hold_s: tuple[float, ...] = (2.0, 10.0, 60.0)
    speed_m_per_s: tuple[float, ...] = (1e-3, 2.5e-4, 4e-3)
    cycles: tuple[int, ...] = (1, 3)

    @classmethod
    def of(cls, sensor: Sensor, history: History) -> Feasible:
        """Presses at the taxels and between them, no deeper than the recording's; the reference in the middle."""
        depth = history.depth_m[history.touched & np.isfinite(history.depth_m)]
        deepest = float(depth.max()) if len(depth) else 2e-3
        place = spread_out(places_m(sensor), sensor.extent_m.mean(axis=0), PLACES)
        return cls(tuple((float(x), float(y)) for x, y in place), (deepest, deepest / 2, deepest / 4))

    @property
    def reference(self) -> Design:
        """The press to beat."""
        return Design(self.position_m[0], self.depth_m[0], self.hold_s[0], self.speed_m_per_s[0], self.cycles[0])


def places_m(sensor: Sensor) -> Array:
    """(n,2) taxels and the middles between neighbours, rounded to 0.01 mm; the sheet's middle where there are none."""
    taxel = sensor.taxel_m
    if len(taxel) < 2:
        return taxel if len(taxel) else sensor.extent_m.mean(axis=0)[None]
    apart = np.hypot(*np.moveaxis(taxel[:, None] - taxel, -1, 0))
    np.fill_diagonal(apart, np.inf)
    i, j = np.nonzero(np.triu(apart < 1.5 * apart.min()))
    return np.unique(np.round(np.concatenate([taxel, 0.5 * (taxel[i] + taxel[j])]), 5), axis=0)


def spread_out(place_m: Array, first_m: Array, count: int) -> Array:
    """(n,2) at most ``count`` of the places (N,2), each as far as can be from those before, from ``first_m`` on."""
    chosen = [int(np.hypot(*(place_m - first_m).T).argmin())]
    while len(chosen) < min(count, len(place_m)):
        away = np.hypot(*np.moveaxis(place_m[:, None] - place_m[chosen], -1, 0)).min(axis=1)
        chosen.append(int(away.argmax()))
    return place_m[chosen]


def next_press(
    skin: Skin, rivals: Mapping[str, Skin], noise_v: float, force_noise_n: float, feasible: Feasible, name: str
) -> dict[str, Any] | None:
    """The press that best tells the fitted ``skin`` (called ``name``) from the ``rivals``, each fitted too.

    The rival hardest to tell counts. Returns ``{"reason", "between", "press"}``, or None where no feasible press
    tells them apart. ``noise_v`` of a reading, ``force_noise_n`` of the load cell (NaN: there is none).
    """
    if not rivals:
        return None
    coarse = [replace(s, sheet=SheetModel(displaced(s), COARSE)) for s in (skin, *rivals.values())]
    known: dict[Design, float] = {}

    def worst_case(design: Design) -> float:
        if design not in known:
            known[design] = min(
                discrimination(coarse[0], rival, design, noise_v, force_noise_n) for rival in coarse[1:]
            )
        return known[design]

    best = reference = feasible.reference
    for _ in range(ROUNDS):
        for coordinate in ("hold_s", "cycles", "speed_m_per_s", "depth_m", "position_m"):
            designs = [replace(best, **{coordinate: choice}) for choice in getattr(feasible, coordinate)]
            enough = NEARLY * max(worst_case(d) for d in designs)
            best = min((d for d in designs if worst_case(d) >= enough), key=lambda d: (d.duration_s, -worst_case(d)))
    if worst_case(best) < NOTHING:
        return None
    return {
        "reason": _reason(best, reference, worst_case(best), worst_case(reference)),
        "between": [name, *rivals],
        "press": [best.as_builtins()],
    }


def _reason(best: Design, reference: Design, expected: float, before: float) -> str:
    words = {
        "position_m": f"at ({1e3 * best.position_m[0]:.0f}, {1e3 * best.position_m[1]:.0f}) mm",
        "depth_m": f"{1e3 * best.depth_m:.2g} mm deep",
        "hold_s": f"held for {best.hold_s:g} s",
        "speed_m_per_s": f"at {1e3 * best.speed_m_per_s:.2g} mm/s",
        "cycles": f"{best.cycles} times",
    }
    own = [text for key, text in words.items() if getattr(best, key) != getattr(reference, key)]
    what = f"a press {', '.join(own)}" if own else "one more press in the middle"
    return f"they differ most in {what}: expected half chi-square {expected:.3g}, {before:.3g} in a plain press"


# what two models make of a press ---------------------------------------------------------------------------------


def discrimination(skin: Skin, rival: Skin, design: Design, noise_v: float, force_noise_n: float) -> float:
    """Expected half chi-square between two skins' predictions of a press, beyond what refitting absorbs."""
    trial = Trial.of(skin, design, noise_v, force_noise_n, _read_alike(skin, rival))
    predicted, foreign = trial.predicted(skin), trial.predicted(rival)
    own = [effect for effect in rival.effects if effect not in skin.effects]
    absorbed = [
        *trial.recalibrated(skin, predicted),
        *trial.refitted(skin, predicted, skin.effects),
        *trial.refitted(rival, foreign, own),
    ]
    apart, directions = foreign - predicted, np.stack(absorbed)
    along = directions @ apart
    gram = np.eye(len(directions)) + directions @ directions.T
    return float(0.5 * (apart @ apart - along @ np.linalg.solve(gram, along)))


def _read_alike(skin: Skin, rival: Skin) -> bool:
    """Whether two skins differ by effects of the foam alone that change no reading at equal force."""
    differing = set(skin.effects) ^ set(rival.effects)
    return all(isinstance(e, FoamEffect) and type(e).felt_n is FoamEffect.felt_n for e in differing)


@dataclass(frozen=True, eq=False)
class Trial:
    """A press thinned to few frames, ``stands_for`` (T,) how many each, and what is measured in it.

    ``force_n`` (T,1) is what the load cell is taken to say: any model's readings are predicted at these forces.
    ``unread``: the readings are left out, for all models give the same.
    """

    history: History
    stands_for: Array
    force_n: Array
    speed_m_per_s: float
    noise_v: float
    force_noise_n: float
    unread: bool

    @classmethod
    def of(cls, skin: Skin, design: Design, noise_v: float, force_noise_n: float, unread: bool = False) -> Trial:
        """The press as the rig would carry it out on a skin."""
        rows = frames(plan_from_presses([design.as_builtins()]))
        time_s, depth, phase, count = (np.array(column) for column in zip(*rows, strict=True))
        place = np.where((phase != Phase.REST)[:, None], np.array(design.position_m), np.nan)[:, None]
        unknown, press = np.full((len(time_s), 1), np.nan), np.zeros(len(time_s), dtype=np.int64)
        history = History(time_s, press, phase.astype(np.uint8), place, depth[:, None], unknown)
        force_n = skin.force_n(history)
        return cls(history, count.astype(float), force_n, design.speed_m_per_s, noise_v, force_noise_n, unread)

    def predicted(self, skin: Skin) -> Array:
        """Changes of all readings from rest, then the load cell's forces, in units of their noise."""
        return np.concatenate([self.voltage(skin, self.history, self.force_n), self.load(skin)])

    def voltage(self, skin: Skin, history: History, force_n: Array) -> Array:
        """The readings' part; what moves within a scan moves at the stage's own speed."""
        if self.unread:
            return np.zeros(0)
        now = replace(skin, effects=tuple(_at_speed(effect, self.speed_m_per_s) for effect in skin.effects))
        readings = now.readings_v(history, force_n).reshape(len(history), -1)
        return np.asarray(np.sqrt(self.stands_for[1:, None]) * (readings[1:] - readings[0]) / self.noise_v).ravel()

    def load(self, skin: Skin) -> Array:
        """The load cell's part; empty where there is none."""
        if not np.isfinite(self.force_noise_n):
            return np.zeros(0)
        return np.asarray(np.sqrt(self.stands_for[1:]) * skin.force_n(self.history)[1:, 0] / self.force_noise_n)

    def recalibrated(self, skin: Skin, predicted: Array) -> Iterator[Array]:
        """What one standard deviation of a calibration changes: law, its curvature, place, pad."""
        load = self.load(skin)
        voltage = predicted[: len(predicted) - len(load)]
        strength = self.force_n / np.nanmax(self.force_n)
        for force_n in (self.force_n * (1 + LAW_ERROR), self.force_n * (1 + LAW_ERROR * (1 - strength))):
            yield np.concatenate([self.voltage(skin, self.history, force_n) - voltage, 0 * load])
        for shift in PLACE_ERROR_M * np.eye(2):
            moved = replace(self.history, contact_m=self.history.contact_m + shift)
            yield np.concatenate([self.voltage(skin, moved, self.force_n) - voltage, 0 * load])
        if len(load):
            yield np.concatenate([0 * voltage, PAD_ERROR * load])

    def refitted(self, skin: Skin, predicted: Array, effects: Sequence[Effect]) -> Iterator[Array]:
        """What one standard deviation of the effects' fitted parameters changes; electrodes stay where they are."""
        for effect in effects:
            if isinstance(effect, ElectrodeEffect) and effect.displaces():
                continue
            others = tuple(e for e in skin.effects if e is not effect)
            several = (f"{name}[{k}]" for name in effect.several() for k in range(len(getattr(effect, name))))
            for key in (*effect.parameters(), *several):
                known, value = effect.known(key), effect.value(key)
                error = min(KNOWN * abs(value), known.typical)
                if value == known.neutral or error == 0:
                    continue
                error = error if value + error <= known.high else -error
                changed = replace(skin, effects=(*others, effect.changed({key: value + error})))
                yield self.predicted(changed) - predicted


def frames(plan: Plan) -> Iterator[tuple[float, float, int, int]]:
    """Time, depth, phase and number of frames stood for, of the few frames predicted; the first is at rest."""
    (press,) = plan.presses
    yield 0.0, np.nan, Phase.REST, press.rest_frames
    now, depth = 0.0, 0.0
    runs: list[list[tuple[float, float, int]]] = []
    for step in press.steps:
        target = depth if step.depth_m is None else step.depth_m
        if not runs or runs[-1][-1][2] != step.phase:
            runs.append([])
        for _ in range(step.frames):
            now += max(plan.period_s, abs(target - depth) / press.speed_m_s)
            depth = target
            runs[-1].append((now, depth, int(step.phase)))
    for run in runs:
        chosen = _spread(len(run), run[0][2] == Phase.HOLD)
        count = np.diff(np.append(chosen, len(run)))
        yield from ((*run[frame], int(n)) for frame, n in zip(chosen, count, strict=True))


def _spread(count: int, early: bool) -> NDArray[np.intp]:
    """At most ``FEW`` of ``count`` frames, the first and last among them; ``early``: closer together at the start."""
    if count <= FEW:
        return np.arange(count)
    even = np.geomspace(1, count, FEW) - 1 if early else np.linspace(0, count - 1, FEW)
    return np.unique(np.round(even).astype(np.intp))


def _at_speed(effect: Effect, speed_m_per_s: float) -> Effect:
    return effect.at_speed(speed_m_per_s) if isinstance(effect, MotionEffect) and effect.moves else effect

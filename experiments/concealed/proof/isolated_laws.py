"""How much of each generator form the model's best fit leaves, law against law: no sheet, no noise.

    python experiments/concealed/proof/isolated_laws.py

Both sides are given the same history: pressures at one place of the fabric, sinkings of the foam, pressures on a
contact, the sheet's points. The effect is fitted by every form that the diagnosis may come to (its starts and what it
frees from there), all their parameters free within their ranges, and what is calibrated with them: the law, the
pad's stiffness, the contacts and the sheet at rest. Left is the rms of what the best one misses, over the rms of what
calibration alone misses. Each form at ``SHARE`` of its largest size, on the skins ``SEEDS``; the mean over
them. Writes isolated_laws.json. What acts on the whole scan is compared on readings of the skin at rest, what the
stage does at the places and in the frames of the skin's own plan. What the model does on other skins or in more than
one spot is measured beside that, and takes no part in what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import seals
from generator.conduction import TwoYarnSheet
from generator.effect import Effect as Form
from generator.effect import Moment
from generator.electrodes import OxidisingContacts, SlidPad
from generator.fabric import triangle
from generator.forms import FORMS
from generator.instrument import GainAndOffset
from generator.layered import point_pressure
from generator.mechanics import TurnedStage
from generator.sheet import Electrodes, Sheet
from generator.simulate import HOLD, REST, Frames, frames_of, moments_of
from generator.skin import Noise, Skin
from generator.skins import drawn
from generator.strength import COARSE
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.diagnosis.search.settling import REFINED
from ertskin.diagnosis.search.smooth_fields import (
    MOST_MODES,
    covariances,
    node_shape,
)
from ertskin.diagnosis.specimen.fit import SpecimenTest
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.crosstalk import Crosstalk
from ertskin.physics.effects.effect import (
    AcquisitionEffect,
    Effect,
    ElectrodeEffect,
    FoamEffect,
    MotionEffect,
    PiezoEffect,
    PlacementEffect,
    SheetEffect,
    Start,
    Strokes,
)
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.field_over_sheet import FieldOverSheet
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.smooth_field import field_design
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]
Seen = tuple[Sensor, Protocol]
Measure = Callable[[type[Form], Skin], float]

OUT = Path(__file__).with_name("isolated_laws.json")
SEEDS = (101, 102)
SHARE = 0.3
BEGUN = 4
"""Starts of each form of a field from which it is fitted, alone and with a smooth field."""
TRIED = 2
"""Starts that are fitted step by step with more of them free."""
NOTHING = 1e-9
"""Share of a variance below which there is none."""
STEP_S = 0.5
HELD = 10
PEAKS = (0.3, 0.8, 0.5, 1.0, 0.6)
"""Presses of the history, over the deepest or the hardest."""
FREED = 3
"""Times that a form may free more of itself."""
TERMS = 3
"""Pads that may be moved: the diagnosis adds a term for each."""
THINNED = 4
"""Every so many frames of the plan, where the instrument changes with time."""
INJECTIONS = 12
"""Of a scan, in which the sheet's warmth is compared."""
DRAWS = 12
"""Threads drawn on a skin: some of them pull pads inside the sheet; on round16 all electrodes lie on the rim."""
SPOTS = 8
"""Of a contact along each side."""
AWAY_M = np.linspace(0.0, 0.008, 5)
"""How far from a contact's middle presses land, along a side and along a diagonal."""
STEP = 1e-3
"""Share by which a contact and the sheet are changed to see what of the readings they calibrate."""


def main() -> None:
    """Measure every form, and write what is left."""
    found: dict[str, Any] = {}
    for name, kinds in FORMS.items():
        for kind in kinds:
            key, line = f"{name}/{kind.form}", f"{name:32s}{kind.form:24s}"
            found[key] = said = _left_on_skins(MEASURED[name], kind)
            line += " ".join(f"{x:.3f}" for x in said["by_skin"])
            if name in IN_PART:
                what, measure = IN_PART[name]
                said["in_part"] = {what: _left_on_skins(measure, kind)["left"]}
                line += f"  {what} {said['in_part'][what]:.3f}"
            for what, measure in ELSEWHERE.get(name, {}).items():
                said.setdefault("elsewhere", {})[what] = one = _left_on_skins(measure, kind)
                line += f"  {what} " + " ".join(f"{x:.3f}" for x in one["by_skin"])
            seals.write_json(OUT, found)
            print(line, flush=True)


def _left_on_skins(measure: Measure, kind: type[Form]) -> dict[str, Any]:
    left = [float(measure(kind, skin_of(seed))) for seed in SEEDS]
    return {"left": round(float(np.mean(left)), 4), "by_skin": [round(x, 4) for x in left]}


def skin_of(seed: int, scan: str = "full", shape: str = "square24") -> Skin:
    """A skin with twelve presses, a square one by default."""
    return drawn(seed, shape, "neoprene", scan, 12, Noise(white_v=1e-3, coloured_share=0.0))


def form_of(kind: type[Form], skin: Skin) -> Form:
    """The form at ``SHARE`` of its largest size, its places drawn on the skin."""
    one = kind(SHARE * kind.largest)
    one.draw(skin, np.random.default_rng([skin.seed, 9]))
    return one


def history() -> tuple[Array, Array]:
    """Times and shares of the deepest (T,): each press in eight steps, a hold, eight steps back, then air."""
    share = []
    for peak in PEAKS:
        way = peak * np.arange(1, 9) / 8
        share += [np.zeros(HELD), way, np.full(HELD, peak), way[-2::-1]]
    every = np.concatenate([*share, np.zeros(HELD)])
    return STEP_S * np.arange(len(every)), every


# ------------------------------------------------------------------------------------------------------------- fitting


def seen_of(skin: Skin) -> Seen:
    """The skin's drawing and its scan, as the model is given them."""
    scan, sensor = skin.protocol, _sensor_of(skin, skin.electrodes)
    timed: dict[str, Any] = {"injection_offset_s": scan.offset_s, "scan_s": scan.scan_s}
    if scan.read is not None:
        return sensor, Protocol.differences(scan.current, scan.read, measured=scan.measured, **timed)
    return sensor, Protocol.against_sink(scan.injection, scan.electrodes, scan.current_a, **timed)


def _sensor_of(skin: Skin, pads: Electrodes) -> Sensor:
    """The skin's drawing with such electrodes."""
    edge_m = None if pads.edge_m is None else np.asarray(pads.edge_m)
    return Sensor(
        skin.outline_m, electrode_center_m=pads.center_m, electrode_size_m=pads.size_m, electrode_edge_m=edge_m
    )


def starts_of(name: str, kind: str, seen: Seen | None = None) -> Iterator[Start]:
    """Every start of an effect for one signal, and what it frees from there; of a small scan where none is given."""
    effect = effect_classes()[name]
    sensor, protocol = seen or (
        Sensor(np.array([[0.0, 0], [0.12, 0], [0.12, 0.12], [0, 0.12]])),
        Protocol.against_sink(np.array([[0, 1], [1, 2], [0, 2]]), 3, 1e-4),
    )
    starts = {
        "force": [*effect.force_starts(), *effect.coupon_starts()],
        "specimen": [*effect.specimen_starts(), *effect.reading_starts(sensor, protocol)],
        "readings": effect.reading_starts(sensor, protocol),
    }[kind]
    for start in starts:
        reached = [start]
        for _ in range(FREED):
            yield from reached
            reached = [more for one in reached for more in one.effect.freer(one.free)]


def left_of(starts: Iterable[Start], missed: Callable[[Effect | None], Array]) -> float:
    """Rms of what the best fit misses over that without the effect; ``missed`` (T,) with an effect, or none."""
    scale = rms(missed(None))
    return min((fitted(start, missed, scale)[0] for start in starts), default=1.0)


def fitted(start: Start, missed: Callable[[Effect | None], Array], scale: float) -> tuple[float, Start]:
    """Rms of what the fit from a start misses over ``scale``, at most all, and where the fit has come to."""
    if not start.free:
        return min(1.0, rms(missed(start.effect)) / scale), start
    known = [start.effect.known(key) for key in start.free]
    at = _begun(start)

    def effect_of(x: Array) -> Effect:
        return start.effect.changed(dict(zip(start.free, map(float, x), strict=True)))

    fit = least_squares(
        lambda x: np.asarray(missed(effect_of(x)) / scale),
        [at[key] for key in start.free],
        bounds=([k.low for k in known], [k.high for k in known]),
        x_scale=[k.typical for k in known],
        max_nfev=30,
    )
    return min(1.0, rms(fit.fun)), replace(start, effect=effect_of(fit.x))


def left_step_by_step(starts: Iterable[Start], missed: Callable[[Effect | None], Array]) -> float:
    """The same where forms are too many to fit them all: the best starts are fitted with ever more of them free.

    As in the diagnosis, each from where the fit before has come to, at most ``REFINED`` times, ``TRIED`` of them.
    """
    scale = rms(missed(None))
    begun = sorted((fitted(start, missed, scale) for start in starts), key=lambda found: found[0])[:TRIED]
    for number, (left, one) in enumerate(begun):
        for _ in range(REFINED):
            freed = [fitted(more, missed, scale) for more in one.effect.freer(one.free)]
            better = min(freed, key=lambda found: found[0], default=(1.0, one))
            if better[0] >= left:
                break
            left, one = better
        begun[number] = left, one
    return min((left for left, _ in begun), default=1.0)


def rms(wrong: Array) -> float:
    """Of all of an array."""
    return float(np.sqrt(np.mean(wrong**2)))


def _begun(start: Start) -> dict[str, float]:
    """Values to begin from, inside their ranges and away from where the effect is none."""
    found = {}
    for key in start.free:
        known, value = start.effect.known(key), start.effect.value(key)
        value += known.typical if known.defining and value == known.neutral else 0.0
        margin = 1e-6 * (known.high - known.low)
        found[key] = float(np.clip(value, known.low + margin, known.high - margin))
    return found


# ------------------------------------------------------------------------------------------------------ law by law


def fabric(kind: type[Form], skin: Skin) -> float:
    """Resistance at one place over a history of pressures, the law's shape fitted anew as to a specimen."""
    time_s, share = history()
    pressure = share * skin.law.top_pa
    form = form_of(kind, skin)
    form.start(1)
    said = [0.0]
    for now in pressure[1:]:
        felt = form.felt(np.array([now]), STEP_S)
        said.append(float(form.gain(skin.law.log_gain(felt), np.array([now]), STEP_S)[0]))
    test = SpecimenTest(pressure, np.exp(-np.array(said)), time_s)

    def missed(effect: Effect | None) -> Array:
        return test.residual(() if effect is None else (cast(PiezoEffect, effect),))

    return left_of(starts_of(form.name, "specimen"), missed)


def foam(kind: type[Form], skin: Skin) -> float:
    """Force at one place over a history of sinkings, the pad's stiffness fitted anew."""
    time_s, share = history()
    height, deepest = skin.layers[0].thickness_m, max(float(np.max(press.depth_m)) for press in skin.plan.presses)
    sink, touched = share * deepest, share > 0
    press = np.cumsum(np.diff(touched.astype(int), prepend=0) == 1)
    part = form_of(kind, skin).foam()
    assert part is not None
    said = np.zeros(len(sink))
    for t in range(1, len(sink)):
        if touched[t] and not touched[t - 1]:
            part.begin(np.zeros(2), 1.0, height)
        if press[t] > 0:
            said[t] = max(part.force(sink[t], sink[t], STEP_S), 0.0)
            part.settle(sink[t], sink[t], STEP_S)
    still = np.zeros(len(sink), dtype=np.intp)
    strokes = Strokes(sink, sink, time_s, touched, still, press.astype(np.int64), height)

    def missed(effect: Effect | None) -> Array:
        force = strokes.elastic_n if effect is None else cast(FoamEffect, effect).reaction_n(strokes.elastic_n, strokes)
        stiffness = (force @ said) / max(force @ force, 1e-300)
        return np.asarray((stiffness * force - said) * touched)

    return left_of(starts_of(kind.name, "force"), missed)


def contact(kind: type[Form], skin: Skin) -> float:
    """Log conductance of a contact under pressures up to the specimen's largest stress."""
    pressure = triangle(skin.law.top_pa)
    said = np.log(form_of(kind, skin).admittance(np.ones(len(pressure)), pressure))
    ohm, now = np.full((len(pressure), 1), 1e6), np.zeros(len(pressure))

    def missed(effect: Effect | None) -> Array:
        if effect is None:
            return said
        pressed = cast(ElectrodeEffect, effect).contact_resistance_ohm(ohm, pressure[:, None], now)
        return np.asarray(np.log(ohm / pressed)[:, 0] - said)

    return left_of(starts_of(kind.name, "readings"), missed)


def pressed_unevenly(kind: type[Form], skin: Skin, whole: bool, evenly: bool = False) -> float:
    """Log conductance of a contact that is pressed in part: of the ``whole`` of it, or of every spot.

    Up to the specimen's largest stress; the model's law is that of every spot or, ``evenly``, of the mean pressure.
    """
    pressure = _under_a_contact(skin)
    form, flat = form_of(kind, skin), pressure.ravel()
    said_s = form.admittance(np.ones(len(flat)), flat).reshape(pressure.shape)
    felt = np.broadcast_to(pressure.mean(axis=1, keepdims=True), pressure.shape) if evenly else pressure
    ohm, now = np.full(pressure.shape, 1e6), np.zeros(len(pressure))

    def log_of(conductance: Array) -> Array:
        return np.log(conductance.mean(axis=1) if whole else conductance.ravel())

    def missed(effect: Effect | None) -> Array:
        if effect is None:
            return log_of(said_s)
        pressed = cast(ElectrodeEffect, effect).contact_resistance_ohm(ohm, felt, now)
        return log_of(ohm / pressed) - log_of(said_s)

    starts = starts_of(kind.name, "readings")
    return left_of((one for one in starts if cast(ContactPressureDependence, one.effect).evenly == evenly), missed)


def _under_a_contact(skin: Skin) -> Array:
    """(T,Q) pressure at the spots of a contact while the indenter lands at several places, at several forces."""
    size_m = skin.electrodes.size_m[0]
    x, y = ((np.arange(SPOTS) + 0.5) / SPOTS * side - 0.5 * side for side in size_m)
    spot_m = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 1, 2)
    ways = np.array([[1.0, 0.0], [0.7071, 0.7071]])
    places_m = (AWAY_M[:, None, None] * ways).reshape(-1, 2)
    unit = point_pressure(skin.layers, skin.interface)
    pressure = np.array(
        [unit(np.linalg.norm(spot_m - place_m - skin.points_m, axis=-1)).mean(axis=1) for place_m in places_m]
    )
    share = np.arange(1, 9) / 8
    return np.asarray(np.multiply.outer(share, pressure / pressure.max()).reshape(-1, len(spot_m)) * skin.law.top_pa)


def field(kind: type[Form], skin: Skin) -> float:
    """A map over the whole sheet but for its mean: a smooth field, or a spot, slope, line or step, alone or with one.

    All that the diagnosis may fit where readings tell of the whole sheet; the smooth field's sizes are free.
    """
    point = _over(skin, 60)
    said = form_of(kind, skin).map(point)  # type: ignore[attr-defined]
    bases = [np.zeros((len(point), 0)), *smooth_bases(point, skin.box_m)]
    best = min(rms(_unexplained(basis, said)) for basis in bases)
    for basis, start in _promising(said, list(starts_of(kind.name, "readings", seen_of(skin))), bases, point, skin):

        def missed(effect: Effect | None, basis: Array = basis) -> Array:
            return _unexplained(basis, said - (0.0 if effect is None else _map_of(effect, point, skin)))

        best = min(best, left_of([start], missed) * rms(missed(None)))
    return best / rms(_unexplained(bases[0], said))


def smooth_bases(point_m: Array, extent_m: Array) -> Iterator[Array]:
    """(N,K) of every covariance that the search tries: its modes, at most ``MOST_MODES``, at points (N,2) in metre.

    Those that vary most over the points, orthonormal and without a mean; ``extent_m`` (2,2) is the sheet's box.
    """
    shape = node_shape(extent_m)
    design = field_design(shape, point_m, extent_m)
    for half in covariances(extent_m):
        at_points = design @ half
        at_points -= at_points.mean(axis=0)
        _, variance, turned = np.linalg.svd(at_points.T @ at_points)
        kept = variance[:MOST_MODES] > variance[0] * NOTHING
        yield at_points @ (turned[:MOST_MODES][kept] / np.sqrt(variance[:MOST_MODES][kept])[:, None]).T


def _unexplained(basis: Array, value: Array) -> Array:
    """What of values (N,...) neither their mean nor a basis (N,K) explains."""
    value = value - value.mean(axis=0)
    return np.asarray(value - basis @ (basis.T @ value))


def _promising(
    said: Array, starts: list[Start], bases: list[Array], point: Array, skin: Skin
) -> Iterator[tuple[Array, Start]]:
    """Bases and starts of each form that leave least of a map ``said`` (N,) at points (N,2) in metre, to first order.

    ``BEGUN`` of them alone, with the first basis, which is empty, and as many with a smooth field.
    """
    shape = _unexplained(
        bases[0], np.stack([_map_of(s.effect.changed(_begun(s)), point, skin) for s in starts], axis=1)
    )
    whole = (shape**2).sum(axis=0)
    left = np.zeros((len(bases), len(starts)))
    for number, basis in enumerate(bases):
        wanted = _unexplained(basis, said)
        free = np.maximum(whole - ((basis.T @ shape) ** 2).sum(axis=0), NOTHING * whole)
        left[number] = wanted @ wanted - (wanted @ shape) ** 2 / free
    for form in sorted({start.free for start in starts}):
        of_form = np.array([k for k, start in enumerate(starts) if start.free == form])
        for first, last in ((0, 1), (1, len(bases))):
            some = left[first:last, of_form]
            for k in some.min(axis=0).argsort()[:BEGUN]:
                yield bases[first + int(some[:, k].argmin())], starts[of_form[k]]


def _map_of(effect: Effect, point: Array, skin: Skin) -> Array:
    """(N,) logarithm of the factor at points (N,2) in metre."""
    return cast(FieldOverSheet, effect).logarithm(point, skin.box_m)


def _over(skin: Skin, count: int) -> Array:
    """(count**2,2) points in metre all over the sheet's box."""
    x, y = (np.linspace(*skin.box_m[:, k], count) for k in range(2))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def anisotropy(kind: type[Form], skin: Skin) -> float:
    """The tensor over the sheet at rest, its size fitted anew."""
    form = form_of(kind, skin)
    assert isinstance(form, TwoYarnSheet)
    point = _over(skin, 40)
    both = np.array([1.0, np.sqrt(2.0), 1.0])  # xy counts twice
    said = form.direction(point, np.zeros(len(point)))[:, [0, 0, 1], [0, 1, 1]] * both

    def missed(effect: Effect | None) -> Array:
        even = np.ones(len(point))
        tensor = np.array([1.0, 0.0, 1.0]) * even[:, None]
        if effect is not None:
            tensor = cast(SheetEffect, effect).conductivity_s(even, point, skin.box_m) * both
        return np.ravel((tensor * said).sum() / (tensor**2).sum() * tensor - said)

    return left_of(starts_of(kind.name, "readings"), missed)


def warming(kind: type[Form], skin: Skin) -> float:
    """Log conductance of the sheet in air over ten minutes, all its places, as one drift of the whole sheet."""
    form = form_of(kind, skin)
    form.start(len(skin.taxel_m))
    time_s = np.arange(0.0, 600.0, 5.0)
    rows = [form.sheet(skin.taxel_m, Moment(float(t), 5.0, 0, 0, np.zeros((0, 2)), np.zeros(0))) for t in time_s]
    said = np.array([np.zeros(len(skin.taxel_m)) if row is None else row for row in rows])
    said, seen = said - said[0], seen_of(skin)

    def missed(effect: Effect | None) -> Array:
        if effect is None:
            return said.ravel()
        drift = cast(SheetEffect, effect)
        warmth = drift.warmth(skin.taxel_m, time_s, *seen)
        uneven = 0.0 if warmth is None else np.multiply.outer(warmth[1], warmth[0])
        return np.ravel(uneven - np.log(drift.drift(time_s))[:, None] - said)

    return left_of(starts_of(kind.name, "readings"), missed)


def landing(kind: type[Form], skin: Skin) -> float:
    """How far from each sensing point the indenter lands."""
    form, middle = form_of(kind, skin), skin.box_m.mean(axis=0)
    assert isinstance(form, TurnedStage)
    said = form.shift(skin.taxel_m)

    def missed(effect: Effect | None) -> Array:
        if effect is None:
            return said.ravel()
        return np.ravel(cast(PlacementEffect, effect).contact_m(skin.taxel_m, middle) - skin.taxel_m - said)

    return left_of(starts_of(kind.name, "readings"), missed)


def pads(kind: type[Form], skin: Skin, terms: int = TERMS) -> float:
    """How far every electrode lies from where it is drawn; ``terms`` of them are moved, each by a term of its own."""
    form, (sensor, _) = form_of(kind, skin), seen_of(skin)
    assert isinstance(form, SlidPad)
    true_m = form.electrodes(skin.electrodes).center_m
    moved_m = true_m - sensor.electrode_center_m
    for number in np.argsort(-np.hypot(*moved_m.T))[:terms]:
        sensor = ElectrodeDisplacement(int(number), *map(float, moved_m[number])).geometry(sensor)
    return rms(true_m - sensor.electrode_center_m) / rms(moved_m)


def thread(kind: type[Form], skin: Skin) -> float:
    """The same by one term alone, whose neighbours one thread pulls along."""
    form, (sensor, _) = form_of(kind, skin), seen_of(skin)
    assert isinstance(form, SlidPad)
    true_m = form.electrodes(skin.electrodes).center_m
    moved_m = true_m - sensor.electrode_center_m
    number = int(np.argmax(np.hypot(*moved_m.T)))
    ways = [(side, pulled) for side in (0, 1, -1) for pulled in np.linspace(0.0, 0.95, 39).tolist()]
    terms = [ElectrodeDisplacement(number, *map(float, moved_m[number]), pulled=p, side=side) for side, p in ways]
    return min(rms(true_m - term.geometry(sensor).electrode_center_m) for term in terms) / rms(moved_m)


def threads(kind: type[Form], skin: Skin, shape: str = "square24") -> float:
    """The same by one term as the diagnosis begins and frees it, all its parameters fitted; the mean over ``DRAWS``."""
    skin = skin_of(skin.seed, shape=shape)
    drawing, protocol = seen_of(skin)
    every = list(starts_of(kind.name, "readings", (drawing, protocol)))
    left = []
    for number in range(DRAWS):
        form = kind(SHARE * kind.largest)
        form.draw(skin, np.random.default_rng([skin.seed, 9, number]))
        said = _places_m(_sensor_of(skin, form.electrodes(skin.electrodes))) - _places_m(drawing)
        most = int(np.abs(said).max(axis=(1, 2)).argmax())

        def missed(effect: Effect | None, said: Array = said) -> Array:
            moved = drawing if effect is None else cast(ElectrodeDisplacement, effect).geometry(drawing)
            return np.ravel(_places_m(moved) - _places_m(drawing) - said)

        left.append(left_of((s for s in every if getattr(s.effect, "electrode", -1) == most), missed))
    return float(np.mean(left))


def _places_m(sensor: Sensor) -> Array:
    """(L,1,2) middles of pads, or (L,2,2) ends of electrodes on the rim."""
    edge_m = sensor.electrode_edge_m
    return sensor.electrode_middle_m[:, None] if edge_m is None else edge_m


def contact_paths(kind: type[Form], skin: Skin) -> float:
    """Resistance of every contact in every frame of the plan, as measured at rest and straight in between."""
    form, frames = form_of(kind, skin), frames_of(skin)
    assert isinstance(form, OxidisingContacts)
    said = np.array([form.contact(skin.contact_ohm, moment) for moment in _scans(skin, frames)])
    rest = frames.phase == REST
    knots, ohm = tuple(frames.time_s[rest].tolist()), np.broadcast_to(skin.contact_ohm, said.shape)
    for number in form.details["electrodes"]:
        path = ContactDrift(number, knots, tuple((said - ohm)[rest, number].tolist()))
        ohm = path.contact_resistance_ohm(ohm, np.zeros(said.shape), frames.time_s)
    wrong = ohm - said
    return rms(wrong - wrong.mean(axis=0)) / rms(said - said.mean(axis=0))


def _scans(skin: Skin, frames: Frames) -> list[Moment]:
    """The middle of every scan of the plan."""
    return [moment for moment in moments_of(skin, frames) if moment.frame >= 0]


def undriven(kind: type[Form], skin: Skin) -> float:
    """The same of a scan in which no driven electrode is read: the instrument may pass it, the model isn't told."""
    return instrument(kind, skin_of(skin.seed, "adjacent"))


def instrument(kind: type[Form], skin: Skin) -> float:
    """Readings of the skin at rest as long as its plan, every contact and the sheet fitted anew.

    A channel that is off is known, and so is where readings stop: both are measured.
    """
    seen, form = seen_of(skin), form_of(kind, skin)
    taken_mask = seen[1].taken
    voltage, changes = _at_rest(skin)
    scans = _scans(skin, frames_of(skin))
    # Nothing but a gain depends on time.
    scans = scans[::THINNED] if isinstance(form, GainAndOffset) else scans[:1]
    said = np.array([form.voltage(voltage, moment.frame, moment.time_s) for moment in scans])[:, taken_mask]
    true = np.repeat(seen[1].filled(voltage)[None], len(scans), axis=0)
    time_s, changes = np.array([moment.time_s for moment in scans]), seen[1].filled(changes)
    changes = changes[changes.any(axis=(1, 2))]  # No contact where no driven electrode is read.

    def missed(effect: Effect | None) -> Array:
        def read(voltage_v: Array) -> Array:
            if effect is None:
                return voltage_v[:, taken_mask]
            scaled = cast(AcquisitionEffect, effect).scaled_to(float(np.abs(voltage).max()))
            return scaled.read_v(voltage_v, seen[1], time_s)[:, taken_mask]

        out = read(true)
        taken = np.array([read(true + change) - out for change in changes]).reshape(len(changes), out.size)
        wrong = np.ravel(out - said)
        return np.asarray(wrong - np.linalg.lstsq(taken @ taken.T, taken @ wrong, rcond=None)[0] @ taken)

    channel = form.details.get("channel")
    if kind.name == Crosstalk.name:
        return left_step_by_step(Crosstalk.reading_starts(*seen), missed)
    every = starts_of(kind.name, "readings", seen)
    starts = [start for start in every if channel in (None, getattr(start.effect, "channel", None))]
    if kind.name == AdcSaturation.name:
        starts.append(Start(AdcSaturation(limit_v=float(said.max()), lowest_v=float(said.min())), ()))
    return left_of(starts, missed)


def _at_rest(skin: Skin) -> tuple[Array, Array]:
    """(K,M) readings of the skin at rest, and (L+1,K,M) what a share ``STEP`` of each contact and the sheet adds."""
    sheet = Sheet(skin.outline_m, skin.electrodes, COARSE)
    specific = 1.0 / (skin.contact_ohm * skin.electrodes.extent)
    admittance = np.where(sheet.pad >= 0, specific[sheet.pad], 0.0)[:, None]
    conductance = np.full(sheet.weight.shape, 1.0 / skin.sheet_ohm)
    transfer = sheet.transfer(conductance, np.broadcast_to(admittance, sheet.weight.shape), specific)
    parts = [*(np.diag(row) for row in np.diag(skin.contact_ohm)), transfer]
    return skin.protocol.readings(transfer), STEP * np.array([skin.protocol.readings(part) for part in parts])


def motion(kind: type[Form], skin: Skin, held: bool = True) -> float:
    """Depth early, halfway and late in the scan of every frame of the plan, the pad's stiffness fitted anew.

    With frames in which the press is ``held``, or without; from the last of them the stage sets out again.
    """
    form, frames = form_of(kind, skin), frames_of(skin)
    history, pressed = _history(frames), ~np.isin(frames.phase, [REST] if held else [REST, HOLD])
    within = np.array([0.02, 0.5, 0.98])
    still = np.repeat(frames.depth_m, len(within), axis=1)
    said = still.copy()
    for moment in form.moved(moments_of(skin, frames)):
        if moment.frame >= 0 and len(moment.depth_m):
            said[moment.frame, np.abs(within - moment.within).argmin()] = moment.depth_m[0]

    def missed(effect: Effect | None) -> Array:
        depth = still
        if effect is not None:
            after_s = skin.protocol.scan_s * np.array([0.0, *within, 1.0])
            depth = cast(MotionEffect, effect).depth_m(history, after_s)[:, 1:-1, 0]
        depth, wanted = depth[pressed], said[pressed]
        return np.ravel((depth * wanted).sum() / (depth**2).sum() * depth - wanted)

    starts = [s for signal in ("readings", "force") for s in starts_of(kind.name, signal, seen_of(skin))]
    return left_of(starts, missed)


def _history(frames: Frames) -> History:
    """Frames as the model is given them, forces unknown."""
    unknown = np.full(frames.depth_m.shape, np.nan)
    return History(frames.time_s, frames.press, frames.phase, frames.contact_m, frames.depth_m, unknown)


def heat(kind: type[Form], skin: Skin) -> float:
    """Log conductance of the sensing points as injections of every scan of the plan meet it, the sheet fitted anew."""
    seen, form = seen_of(skin), form_of(kind, skin)
    form.start(len(skin.taxel_m))
    frames = frames_of(skin)
    moments = moments_of(skin, frames)
    rows = [(moment.frame, form.sheet(skin.taxel_m, moment)) for moment in moments]
    said = np.array([row for frame, row in rows if frame >= 0])[:, None, :]
    met = np.linspace(0, seen[1].shape[0] - 1, INJECTIONS).astype(int)

    def missed(effect: Effect | None) -> Array:
        within, stays = np.zeros(len(met)), np.zeros_like(said)
        if effect is not None:
            factor = cast(AcquisitionEffect, effect).distorted_v(np.ones(seen[1].shape), seen[1])
            within = np.log(factor[met, 0])
            warmth = cast(SheetEffect, effect).warmth(skin.taxel_m, frames.time_s, *seen)
            if warmth is not None:
                stays = np.multiply.outer(warmth[1], warmth[0])[:, None, :]
        wrong = stays - within[None, :, None] - said
        return np.ravel(wrong - wrong.mean())

    return left_of(starts_of(kind.name, "readings", seen), missed)


MEASURED: dict[str, Measure] = {
    "nonlinear_foam": foam,
    "viscoelastic_foam": foam,
    "foam_hysteresis": foam,
    "foam_softening": foam,
    "indenter_offset": landing,
    "piezo_hysteresis": fabric,
    "piezo_creep": fabric,
    "piezo_inhomogeneity": field,
    "sheet_inhomogeneity": field,
    "sheet_anisotropy": anisotropy,
    "temperature_drift": warming,
    "self_heating": heat,
    "contact_pressure_dependence": contact,
    "electrode_displacement": pads,
    "contact_drift": contact_paths,
    "channel_gain": instrument,
    "crosstalk": instrument,
    "adc_saturation": instrument,
    "scan_skew": motion,
}
IN_PART: dict[str, tuple[str, Measure]] = {
    "electrode_displacement": ("by one term", thread),
    "scan_skew": ("but for frames held", partial(motion, held=False)),
}
"""What is measured beside the whole."""
ELSEWHERE: dict[str, dict[str, Measure]] = {
    "contact_pressure_dependence": {
        "every spot": partial(pressed_unevenly, whole=False),
        "every spot by the mean": partial(pressed_unevenly, whole=False, evenly=True),
        "whole contact": partial(pressed_unevenly, whole=True),
        "whole contact by the mean": partial(pressed_unevenly, whole=True, evenly=True),
    },
    "electrode_displacement": {
        "by one term, many pads": threads,
        "by one term, sixteen pads": partial(threads, shape="square16"),
        "by one term, on the rim": partial(threads, shape="round16"),
    },
    "crosstalk": {"driven electrodes not read": undriven},
}
"""What is measured where ``MEASURED`` doesn't show the law at work: takes no part in what is left."""


if __name__ == "__main__":
    main()

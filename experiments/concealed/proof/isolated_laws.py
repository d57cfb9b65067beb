"""How much of each generator form the model's best fit leaves, law against law: no sheet, no noise.

    python experiments/concealed/proof/isolated_laws.py

Both sides are given the same history: pressures at one place of the fabric, sinkings of the foam, pressures on a
contact, the sheet's points. The effect is fitted by every form that the diagnosis may come to (its starts and what it
frees from there), all their parameters free within their ranges, and what is calibrated with them: the law, the
pad's stiffness, the contact and the sheet at rest. Left is the rms of what the best one misses, over the rms of what
calibration alone misses. Each form at ``SHARE`` of its largest size, on the skins ``SEEDS``; the mean over
them. Writes isolated_laws.json; what is measured in another way or not at all isn't in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import seals
from generator.conduction import TwoYarnSheet
from generator.effect import Effect as Form
from generator.effect import Moment
from generator.fabric import triangle
from generator.forms import FORMS
from generator.skin import Noise, Skin
from generator.skins import drawn
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ertskin.diagnosis.specimen.fit import SpecimenTest
from ertskin.physics.effects.effect import (
    Effect,
    ElectrodeEffect,
    FoamEffect,
    PiezoEffect,
    SheetEffect,
    Start,
    Strokes,
)
from ertskin.physics.effects.registry import effect_classes
from ertskin.physics.effects.smooth_field import field_design
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

OUT = Path(__file__).with_name("isolated_laws.json")
SEEDS = (101, 102)
SHARE = 0.3
NODES = (7, 7)
"""Of the smooth field that the laws committed were measured with."""
STEP_S = 0.5
HELD = 10
PEAKS = (0.3, 0.8, 0.5, 1.0, 0.6)
"""Presses of the history, over the deepest or the hardest."""
FREED = 3
"""Times that a form may free more of itself."""


def main() -> None:
    """Measure every form that can be isolated, and write what is left."""
    found: dict[str, Any] = {}
    for name, kinds in FORMS.items():
        measure = MEASURED.get(name)
        for kind in kinds if measure is not None else ():
            left = [float(measure(kind, skin_of(seed))) for seed in SEEDS]
            found[f"{name}/{kind.form}"] = {
                "left": round(float(np.mean(left)), 4),
                "by_skin": [round(x, 4) for x in left],
            }
            seals.write_json(OUT, found)
            print(f"{name:32s}{kind.form:24s}" + " ".join(f"{x:.3f}" for x in left), flush=True)


def skin_of(seed: int) -> Skin:
    """A square skin with twelve presses."""
    return drawn(seed, "square24", "neoprene", "full", 12, Noise(white_v=1e-3, coloured_share=0.0))


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


def starts_of(name: str, kind: str) -> Iterator[Start]:
    """Every start of an effect for one signal, and what it frees from there."""
    effect = effect_classes()[name]
    sensor = Sensor(np.array([[0.0, 0], [0.12, 0], [0.12, 0.12], [0, 0.12]]))
    protocol = Protocol.against_sink(np.array([[0, 1], [1, 2], [0, 2]]), 3, 1e-4)
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


def left_of(starts: Iterator[Start], missed: Callable[[Effect | None], Array]) -> float:
    """Rms of what the best fit misses over that without the effect; ``missed`` (T,) with an effect, or none."""
    scale = float(np.sqrt(np.mean(missed(None) ** 2)))
    best = 1.0
    for start in starts:
        known = [start.effect.parameters()[key] for key in start.free]
        at = _begun(start)

        def wrong(x: Array, start: Start = start) -> Array:
            values = dict(zip(start.free, map(float, x), strict=True))
            return np.asarray(missed(start.effect.changed(values)) / scale)

        fit = least_squares(
            wrong,
            [at[key] for key in start.free],
            bounds=([k.low for k in known], [k.high for k in known]),
            x_scale=[k.typical for k in known],
            max_nfev=30,
        )
        best = min(best, float(np.sqrt(np.mean(fit.fun**2))))
    return best


def _begun(start: Start) -> dict[str, float]:
    """Values to begin from, inside their ranges and away from where the effect is none."""
    found = {}
    for key in start.free:
        known, value = start.effect.parameters()[key], float(getattr(start.effect, key))
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


def field(kind: type[Form], skin: Skin) -> float:
    """A map over the whole sheet, but for its mean, as a spot, a slope and a smooth field on the search's nodes."""
    x, y = (np.linspace(*skin.box_m[:, k], 60) for k in range(2))
    point = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    said = form_of(kind, skin).map(point)  # type: ignore[attr-defined]
    said = said - said.mean()
    unit = (point - point.mean(axis=0)) / np.ptp(point, axis=0)
    smooth = np.column_stack([field_design(NODES, point, skin.box_m), unit, np.ones(len(point))])

    def missed(spot: Array) -> Array:
        squared = ((point - spot[:2]) ** 2).sum(axis=1)
        columns = np.column_stack([smooth, np.exp(-0.5 * squared / np.exp(2 * spot[2]))])
        return np.asarray(columns @ np.linalg.lstsq(columns, said, rcond=1e-10)[0] - said)

    middle = point[np.abs(missed(np.array([*point.mean(axis=0), np.log(0.02)]))).argmax()]
    fit = least_squares(missed, [*middle, np.log(0.01)], x_scale=[0.01, 0.01, 0.3], max_nfev=30)
    return float(np.sqrt(np.mean(fit.fun**2) / np.mean(said**2)))


def anisotropy(kind: type[Form], skin: Skin) -> float:
    """The tensor over the sheet as one tensor everywhere, at rest."""
    form = form_of(kind, skin)
    assert isinstance(form, TwoYarnSheet)
    x, y = (np.linspace(*skin.box_m[:, k], 40) for k in range(2))
    point = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    tensor = form.direction(point, np.zeros(len(point)))
    added = tensor - np.eye(2) * np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 2
    return float(np.sqrt(np.mean((added - added.mean(axis=0)) ** 2) / np.mean(added**2)))


def warming(kind: type[Form], skin: Skin) -> float:
    """Log conductance of the sheet in air over ten minutes, all its places, as one drift of the whole sheet."""
    form = form_of(kind, skin)
    form.start(len(skin.taxel_m))
    time_s = np.arange(0.0, 600.0, 5.0)
    rows = [form.sheet(skin.taxel_m, Moment(float(t), 5.0, 0, 0, np.zeros((0, 2)), np.zeros(0))) for t in time_s]
    said = np.array([np.zeros(len(skin.taxel_m)) if row is None else row for row in rows])
    said = said - said[0]

    def missed(effect: Effect | None) -> Array:
        if effect is None:
            return said.ravel()
        return np.ravel(-np.log(cast(SheetEffect, effect).drift(time_s))[:, None] - said)

    return left_of(starts_of(kind.name, "readings"), missed)


MEASURED: dict[str, Callable[[type[Form], Skin], float]] = {
    "nonlinear_foam": foam,
    "viscoelastic_foam": foam,
    "foam_hysteresis": foam,
    "foam_softening": foam,
    "piezo_hysteresis": fabric,
    "piezo_creep": fabric,
    "piezo_inhomogeneity": field,
    "sheet_inhomogeneity": field,
    "sheet_anisotropy": anisotropy,
    "temperature_drift": warming,
    "contact_pressure_dependence": contact,
}


if __name__ == "__main__":
    main()

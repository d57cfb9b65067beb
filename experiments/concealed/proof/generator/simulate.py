"""From a skin and its effects to the readings: what the stage does, what the pad passes on, what the sheet conducts."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .effect import Effect, Moment
from .foam import Pad
from .layered import Layer, point_pressure, stiffness_n_per_m
from .sheet import Sheet
from .skin import Skin
from .tiles import Region, Tiles

Array = NDArray[np.float64]
REGION_M = 0.016
"""Tiles nearer to a press are solved in full; what it changes farther off is linear in its force."""
FAR_M = 0.05
SECANTS = (0.35, 0.6, 1.0, 1.6, 2.5, 4.0, 8.0)
REST, LOADING, HOLD, UNLOADING = range(4)


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames' columns as the recording has them: commanded, not true."""

    time_s: Array
    press: NDArray[np.int64]
    phase: NDArray[np.uint8]
    contact_m: Array
    depth_m: Array


def frames_of(skin: Skin) -> Frames:
    """When the plan's frames are taken and what the stage is told to do then."""
    rows: list[tuple[float, int, int, Array, Array]] = []
    time = 0.0
    widest = max(len(press.position_m) for press in skin.plan.presses)
    air = np.full((widest, 2), np.nan), np.full(widest, np.nan)
    for number, press in enumerate(skin.plan.presses):
        time += press.gap_s
        rows.append((time, number, REST, *air))
        way = [(LOADING, d, press.step_s) for d in press.depth_m]
        way += [(HOLD, press.depth_m[-1], press.hold_s)] * press.held
        way += [(UNLOADING, d, press.step_s) for d in press.depth_m[-2::-1]]
        for phase, depth, step in way:
            time += step
            place, deep = air[0].copy(), air[1].copy()
            place[: len(press.position_m)], deep[: len(press.position_m)] = press.position_m, depth
            rows.append((time, number, phase, place, deep))
    rows.append((time + skin.plan.presses[-1].gap_s, len(skin.plan.presses), REST, *air))
    columns = list(zip(*rows, strict=True))
    return Frames(
        np.array(columns[0]),
        np.array(columns[1], dtype=np.int64),
        np.array(columns[2], dtype=np.uint8),
        np.array(columns[3]),
        np.array(columns[4]),
    )


def moments_of(skin: Skin, frames: Frames) -> list[Moment]:
    """One moment in the middle of every scan, and one as the stage has left a place."""
    moments: list[Moment] = []
    middle = 0.5 * skin.protocol.scan_s
    for i, time in enumerate(frames.time_s):
        on = np.isfinite(frames.depth_m[i])
        since = float(time + middle - moments[-1].time_s) if moments else 0.0
        moment = Moment(
            float(time + middle), since, int(frames.press[i]), int(frames.phase[i]),
            frames.contact_m[i][on], frames.depth_m[i][on], i,
        )  # fmt: skip
        moments.append(moment)
        if i + 1 < len(frames.time_s) and on.any() and frames.phase[i + 1] == REST:
            step = skin.plan.presses[moment.press].step_s
            moments.append(
                replace(moment, time_s=moment.time_s + step, since_s=step, depth_m=0.0 * moment.depth_m, frame=-1)
            )
    return moments


class Mechanics:
    """Force and pressure of a history, moment by moment."""

    def __init__(self, skin: Skin, effects: Sequence[Effect]) -> None:
        self.skin, self.effects = skin, effects
        self.stiffness = stiffness_n_per_m(skin.layers, skin.interface, skin.diameter_m, skin.points_m)
        self.shares = np.full(len(skin.points_m), 1.0 / len(skin.points_m))
        self.spreads = {1.0: point_pressure(skin.layers, skin.interface, FAR_M)}
        self._fields: dict[bytes, Array] = {}

    def forces(self, moments: Sequence[Moment]) -> tuple[list[Array], list[Array]]:
        """Force (P,) and secant stiffness (P,) at every moment, none in air."""
        forces, secants = [], []
        parts = [[part for effect in self.effects if (part := effect.foam())] for _ in range(2)]
        height = self.skin.layers[0].thickness_m
        pads = [Pad(self.stiffness, self.skin.support_n_per_m, height, p) for p in parts]
        press, air = -1, True
        for moment in moments:
            if len(moment.depth_m) and (moment.press != press or air):
                press = moment.press
                for pad, position in zip(pads, moment.position_m, strict=False):
                    pad.begin(position)
            air = not len(moment.depth_m)
            if air:
                for pad in (p for p in pads if p.used):
                    pad.advance(0.0, moment.since_s)
            both = [pad.advance(float(d), moment.since_s) for pad, d in zip(pads, moment.depth_m, strict=False)]
            forces.append(np.array([f for f, _ in both]))
            secants.append(np.array([s for _, s in both]))
        return forces, secants

    def _spread(self, secant: float) -> object:
        if secant not in self.spreads:
            top = self.skin.layers[0]
            stiffer = Layer(top.name, top.thickness_m, top.youngs_modulus_pa * secant, top.poissons_ratio)
            self.spreads[secant] = point_pressure((stiffer, *self.skin.layers[1:]), self.skin.interface, FAR_M)
        return self.spreads[secant]

    def _field(self, point_m: Array, at_m: Array, share: Array, secant: float) -> Array:
        key = at_m.tobytes() + share.tobytes() + np.array([secant, id(point_m)]).tobytes()
        if key not in self._fields:
            spread, total = self._spread(secant), np.zeros(len(point_m))
            for place, weight in zip(at_m, share, strict=True):
                distance = np.hypot(*(point_m - place).T)
                near = distance < FAR_M
                total[near] += weight * spread(distance[near])  # type: ignore[operator]
            if len(self._fields) > 40:
                self._fields.clear()
            self._fields[key] = total
        return self._fields[key]

    def pressure(self, point_m: Array, moment: Moment, force_n: Array, secant: Array) -> Array:
        """Interface pressure (n,) in Pa at (n,2), before anything the fabric does to it."""
        total = np.zeros(len(point_m))
        for position, force, stiffer in zip(moment.position_m, force_n, secant, strict=True):
            offset, share = self.skin.points_m, self.shares
            for effect in self.effects:
                offset, share = effect.footprint(offset, share, float(force), moment)
            total += force * self._blended(
                point_m, position + offset, share, float(np.clip(stiffer, SECANTS[0], SECANTS[-1]))
            )
        return total

    def _blended(self, point_m: Array, at_m: Array, share: Array, secant: float) -> Array:
        """Between two pads of fixed stiffness, straight in the logarithm of stiffness."""
        if secant == 1.0:
            return self._field(point_m, at_m, share, 1.0)
        upper = int(np.clip(np.searchsorted(SECANTS, secant), 1, len(SECANTS) - 1))
        low, high = SECANTS[upper - 1], SECANTS[upper]
        part = float(np.log(secant / low) / np.log(high / low))
        return (1 - part) * self._field(point_m, at_m, share, low) + part * self._field(point_m, at_m, share, high)


class Fabric:
    """Conductance and contact admittance at the places of a sheet, moment by moment."""

    def __init__(self, skin: Skin, effects: Sequence[Effect], sheet: Sheet) -> None:
        self.skin, self.effects, self.sheet = skin, effects, sheet
        self.point_m = sheet.point_m.reshape(-1, 2)
        for effect in effects:
            effect.start(len(self.point_m))
        factors = [f for effect in effects if (f := effect.sensitivity(self.point_m)) is not None]
        self.sensitivity = np.prod(factors, axis=0) if factors else None
        self.on_pad = np.flatnonzero(np.repeat(sheet.pad >= 0, sheet.weight.shape[1]))
        self.pad_of = np.repeat(sheet.pad, sheet.weight.shape[1])[self.on_pad]

    def electric(self, moment: Moment, pressure_pa: Array) -> tuple[Array, Array, Array]:
        """(conductance (e,q) or (e,q,2,2), admittance (e,q), edge admittance (L,)) after the step to this moment."""
        for effect in self.effects:
            pressure_pa = effect.pressure(self.point_m, pressure_pa, moment)
        felt = np.maximum(pressure_pa, 0.0)
        for effect in self.effects:
            felt = effect.felt(felt, moment.since_s)
        log_gain = self.skin.law.log_gain(felt)
        for effect in self.effects:
            log_gain = effect.gain(log_gain, felt, moment.since_s)
        if self.sensitivity is not None:
            log_gain = log_gain * self.sensitivity
        for effect in self.effects:
            if (change := effect.sheet(self.point_m, moment)) is not None:
                log_gain = log_gain + change
        conductance = np.exp(log_gain) / self.skin.sheet_ohm
        shape = self.sheet.weight.shape
        directed = [d for effect in self.effects if (d := effect.direction(self.point_m, pressure_pa)) is not None]
        if directed:
            conductance = (conductance[:, None, None] * directed[0]).reshape(*shape, 2, 2)
        else:
            conductance = conductance.reshape(shape)
        return conductance, *self._contacts(moment, pressure_pa)

    def _contacts(self, moment: Moment, pressure_pa: Array) -> tuple[Array, Array]:
        contact = self.skin.contact_ohm
        for effect in self.effects:
            contact = effect.contact(contact, moment)
        specific = 1.0 / (contact * self.sheet.electrodes.extent)
        admittance = np.zeros(len(self.point_m))
        value = specific[self.pad_of] if len(self.pad_of) else np.zeros(0)
        for effect in self.effects:
            value = effect.admittance(value, pressure_pa[self.on_pad])
        admittance[self.on_pad] = value
        return admittance.reshape(self.sheet.weight.shape), specific


Electric = tuple[Array, Array, Array]


@dataclass(eq=False)
class Passage:
    """A rest frame and the press after it: moments, total force, which is the deepest, and electric states kept.

    ``solved``: which of the moments the sheet is solved at.
    ``whole``: at every moment with a frame, where something changes outside of the region that no straight line tells.
    """

    moments: list[Moment]
    force_n: list[float]
    peak: int
    solved: list[int]
    region: Region | None
    rest: Electric | None = None
    top: Electric | None = None
    inside: dict[int, Electric] = field(default_factory=dict)
    whole: dict[int, Electric] = field(default_factory=dict)


class Transfers:
    """The transfer matrix at every moment of a recording that has a frame."""

    def __init__(self, skin: Skin, effects: Sequence[Effect], sheet: Sheet) -> None:
        self.skin, self.sheet, self.tiles = skin, sheet, Tiles(sheet)
        self.effects = effects
        self.fabric = Fabric(skin, effects, sheet)
        self.mechanics = Mechanics(skin, effects)
        self._last: tuple[Electric, dict[int, Array]] | None = None

    def _condensed(self, electric: Electric) -> dict[int, Array]:
        """Tiles' complements; those that changed since the last time are condensed anew, the others kept."""
        if self._last is None:
            schur = self.tiles.condense(electric)
        else:
            known, schur = self._last[0], dict(self._last[1])
            changed = np.zeros(len(self.sheet.dofs), dtype=bool)
            for new, old in zip(electric[:2], known[:2], strict=True):
                changed |= (np.abs(new - old) > 1e-9 * np.abs(new)).reshape(len(changed), -1).any(axis=1)
            tiles = np.unique(self.tiles.tile_of[changed])
            if not np.array_equal(electric[2], known[2]) and self.sheet.electrodes.edge_m is not None:
                tiles = np.arange(self.tiles.tiles)
            schur |= self.tiles.condense(electric, tiles)
        self._last = (electric, schur)
        return schur

    def run(
        self, moments: Sequence[Moment], frames: Collection[int] | None = None
    ) -> tuple[list[tuple[Moment, Array]], list[Array]]:
        """(moment, (L,L) transfer matrix) wherever a frame is taken, and the force (P,) at every moment.

        ``frames``: numbers of the frames whose matrices are wanted, all without it. Foam and fabric go through every
        moment all the same.
        """
        forces, secants = self.mechanics.forces(moments)
        self.fabric.electric(replace(moments[0], since_s=0.0), np.zeros(len(self.fabric.point_m)))
        found: list[tuple[Moment, Array]] = []
        rests = [i for i, m in enumerate(moments) if m.phase == REST]
        before: Passage | None = None
        for begin, end in zip(rests, [*rests[1:], len(moments)], strict=True):
            passage = self._passage(moments[begin:end], forces[begin:end], secants[begin:end], frames)
            if before is not None:
                found += self._solved(before, passage)
            before = passage
        assert before is not None
        return found + self._solved(before, None), forces

    def _passage(
        self,
        moments: Sequence[Moment],
        forces: Sequence[Array],
        secants: Sequence[Array],
        frames: Collection[int] | None,
    ) -> Passage:
        """Step the fabric through a rest frame and the press after it; keep what is needed to solve the sheet."""
        places = [m.position_m for m in moments if len(m.position_m)]
        solved = [i for i, m in enumerate(moments) if m.frame >= 0 and (frames is None or m.frame in frames)]
        region = None
        if places and solved:
            region = self.tiles.region(self.tiles.within(np.concatenate(places), REGION_M))
        total = [float(np.sum(f)) for f in forces]
        peak = int(np.argmax(total))
        passage = Passage(list(moments), total, peak, solved, region)
        bends = any(effect.bends for effect in self.effects)
        for i, moment in enumerate(moments):
            electric = self._electric(moment, forces[i], secants[i])
            if i == 0:
                passage.rest = electric
            if i == peak:
                passage.top = electric
            if i in solved and region is not None:
                e = region.elements
                passage.inside[i] = (electric[0][e], electric[1][e], electric[2])
                if bends:
                    passage.whole[i] = electric
        return passage

    def _electric(self, moment: Moment, force_n: Array, secant: Array) -> Electric:
        pressure = np.zeros(len(self.fabric.point_m))
        if len(force_n):
            pressure = self.mechanics.pressure(self.fabric.point_m, moment, force_n, secant)
        return self.fabric.electric(moment, pressure)

    def _solved(self, passage: Passage, after: Passage | None) -> list[tuple[Moment, Array]]:
        """Transfer matrices of a passage; the outside goes straight in time to ``after`` and straight in force, unless
        it bends in between."""
        assert passage.rest is not None
        assert passage.top is not None
        if not passage.solved:
            return []
        if passage.region is None:
            return [(passage.moments[0], self.sheet.transfer(*passage.rest))]
        region, moments = passage.region, passage.moments
        if passage.whole:
            outside = {i: region.outside(self._condensed(electric)) for i, electric in passage.whole.items()}
            return [(moments[i], region.transfer(outside[i], *inside)) for i, inside in passage.inside.items()]
        rest = region.outside(self._condensed(passage.rest))
        top = region.outside(self._condensed(passage.top))
        drift, span = np.zeros_like(rest), 1.0
        if after is not None and after.rest is not None and not _same(after.rest, passage.rest):
            drift = region.outside(self._condensed(after.rest)) - rest
            span = after.moments[0].time_s - moments[0].time_s
        time = [(m.time_s - moments[0].time_s) / span for m in moments]
        load = top - rest - time[passage.peak] * drift
        found = []
        for i, electric in passage.inside.items():
            share = passage.force_n[i] / max(passage.force_n[passage.peak], 1e-9)
            found.append((moments[i], region.transfer(rest + time[i] * drift + share * load, *electric)))
        return found


def _same(one: Electric, other: Electric) -> bool:
    return all(np.allclose(a, b, rtol=1e-9, atol=0.0) for a, b in zip(one, other, strict=True))

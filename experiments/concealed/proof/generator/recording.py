"""A whole recording of a skin with effects: frames, specimen, rigid block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import noise
from .effect import Effect, Moment
from .sheet import Sheet
from .simulate import HOLD, REST, Frames, Transfers, frames_of, moments_of
from .skin import Skin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clean:
    """What would be read without noise: (T,K,M) readings, (T,P) load-cell force, the frames' columns.

    Readings of the frames solved only, where those were chosen.
    """

    voltage_v: Array
    force_n: Array
    frames: Frames
    moments: list[Moment]


@dataclass(frozen=True, eq=False)
class Measured:
    """Everything that goes into a recording file."""

    voltage_v: NDArray[np.float32]
    force_n: Array
    frames: Frames
    specimen: dict[str, Array]
    block: dict[str, Array]


def clean(
    skin: Skin, effects: Sequence[Effect], sheet: Sheet | None = None, chosen: Sequence[int] | None = None
) -> Clean:
    """Simulate without noise; ``sheet`` saves meshing where no effect moves electrodes.

    ``chosen``: numbers of the frames whose readings are wanted, all without it.
    """
    electrodes = skin.electrodes
    for effect in effects:
        electrodes = effect.electrodes(electrodes)
    if sheet is None or electrodes is not skin.electrodes:
        sheet = Sheet(skin.outline_m, electrodes, skin.fineness)
    frames = frames_of(skin)
    moments = moments_of(skin, frames)
    for effect in effects:
        moments = effect.moved(moments)
    chosen = range(len(frames.time_s)) if chosen is None else chosen
    solved, forces = Transfers(skin, effects, sheet).run(moments, set(chosen))
    by_frame: dict[int, list[tuple[Moment, Array]]] = {frame: [] for frame in chosen}
    for moment, transfer in solved:
        by_frame[moment.frame].append((moment, transfer))
    voltage = np.stack([_scan(skin, effects, frame, found) for frame, found in by_frame.items()])
    return Clean(voltage, _load_cell(effects, frames, moments, forces), frames, moments)


def _scan(skin: Skin, effects: Sequence[Effect], frame: int, solved: list[tuple[Moment, Array]]) -> Array:
    """(K,M) readings of one scan; transfer matrices at three times of it go over into one another by a parabola."""
    protocol = skin.protocol
    for effect in effects:
        solved = [(moment, effect.network(transfer, moment)) for moment, transfer in solved]
    if len(solved) == 1:
        voltage = protocol.readings(solved[0][1])
    else:
        t = np.array([m.within for m, _ in solved])
        at = protocol.offset_s / protocol.scan_s
        weight = np.stack(
            [np.prod([(at - t[o]) / (t[i] - t[o]) for o in range(3) if o != i], axis=0) for i in range(3)]
        )
        voltage = sum(w[:, None] * protocol.readings(r) for w, (_, r) in zip(weight, solved, strict=True))
    for effect in effects:
        voltage = effect.voltage(voltage, frame, solved[0][0].time_s)
    return np.asarray(voltage)


def _load_cell(effects: Sequence[Effect], frames: Frames, moments: list[Moment], forces: list[Array]) -> Array:
    """(T,P) mean over each scan, 0 in air."""
    total = np.zeros(frames.depth_m.shape)
    weight = np.zeros(len(total))
    for moment, force in zip(moments, forces, strict=True):
        if moment.frame >= 0:
            share = 1.0 if moment.within != 0.5 or len(force) == 0 else 2.0
            total[moment.frame, : len(force)] += share * force
            weight[moment.frame] += share
    mean = total / weight[:, None]
    first = {m.frame: m for m in moments if m.frame >= 0}
    for effect in effects:
        mean = effect.measured_force(mean, [first[i] for i in range(len(mean))])
    return mean


def measured(skin: Skin, effects: Sequence[Effect], specimen_effects: Sequence[Effect], found: Clean) -> Measured:
    """With noise, counts and everything else the file holds; the noise is drawn from the skin's seed."""
    rng = np.random.default_rng([skin.seed, 7])
    voltage = found.voltage_v
    moving = ~np.isin(found.frames.phase, (REST, HOLD))
    for effect in effects:
        voltage = effect.recorded(voltage, moving, rng)
    voltage = noise.converted(noise.readings(voltage, skin.noise, rng), skin.protocol)
    if skin.protocol.measured is not None:
        voltage = np.where(skin.protocol.measured, voltage, np.nan)
    force = found.force_n + skin.noise.force_n * rng.standard_normal(found.force_n.shape)
    specimen = specimen_test(skin, specimen_effects, rng)
    return Measured(voltage.astype(np.float32), force, found.frames, specimen, _block(skin, rng))


def specimen_test(skin: Skin, effects: Sequence[Effect], rng: np.random.Generator) -> dict[str, Array]:
    """Five cycles of stress on another piece of the cloth, at places of no importance."""
    top, steps, cycles, pace = skin.law.top_pa, 60, 5, 0.5
    one = np.concatenate([np.linspace(0, top, steps + 1), np.linspace(top, 0, steps + 1)[1:]])
    stress = np.concatenate([one] * cycles)
    for effect in effects:
        effect.start(1)
    resistance = np.empty(len(stress))
    for i, p in enumerate(stress):
        felt = np.array([p])
        for effect in effects:
            felt = effect.felt(felt, pace)
        gain = skin.law.log_gain(felt)
        for effect in effects:
            gain = effect.gain(gain, felt, pace)
        resistance[i] = skin.sheet_ohm * np.exp(-gain[0])
    resistance *= 1.0 + skin.noise.specimen * rng.standard_normal(len(stress))
    return {
        "stress_pa": stress,
        "sheet_resistance_ohm_sq": resistance,
        "time_s": pace * np.arange(len(stress)),
        "cycle": np.repeat(np.arange(cycles), len(one)),
    }


def _block(skin: Skin, rng: np.random.Generator) -> dict[str, Array]:
    depth = np.linspace(0.0, 1e-3, 21)
    return {"depth_m": depth, "force_n": skin.support_n_per_m * depth + skin.noise.force_n * rng.standard_normal(21)}

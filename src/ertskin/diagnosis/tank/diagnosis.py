"""A tank or sheet without mechanics: which electrode or channel reads wrong, and where the sheet changed.

The first frame is the empty tank. What no resistor network explains of it belongs to the instrument and is tested
electrode by electrode, and channel by channel where these read differences; one that stands out is blamed and its
columns' gains and offsets are fitted. The rest
of it, which a network explains, says where the electrodes on the rim are (``placement``). Later frames are imaged
against the first.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from ertskin.diagnosis.contract.claims import QUANTILE, Claim, Diagnosis, Estimate, HeldOut, verdict_of
from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.judge.result import Drawing, DrawnFindings, Findings, refused
from ertskin.diagnosis.tank.displaced_electrodes import placed, with_placement
from ertskin.diagnosis.tank.electrode_error import (
    LEVEL,
    ColumnError,
    ElectrodeErrors,
    channel_errors,
    column_errors,
    corrected,
    electrode_errors,
    rms_v,
    surely,
    unexplained_v,
)
from ertskin.diagnosis.tank.figures import electrode_figure, map_figure
from ertskin.diagnosis.tank.inclusions import Imaging
from ertskin.hardware.recording import Recording
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.hypothesis import Measured
from ertskin.physics.effects.registry import measured_as
from ertskin.physics.protocol import Protocol
from ertskin.physics.spikes import completed

Array = NDArray[np.float64]

SPLIT = "every fourth injection, gains and offsets fitted on the others"
MOST_COMPARED = 100
MOST_IMAGED = 4
"""Frames of which the report shows maps."""
LEAST_ERROR = 0.002
"""Rms of what no network explains over that of the readings, below which an instrument's error matters to nobody: 19 of
20 simulated instruments whose gains agree to 0.1 % stay below it (experiments/real/ottawa/nulls.py)."""
LEAST_GAIN = 0.006
"""Gain, or offset over the readings' rms, from which a channel's error is named: of these scans 98 in 100 seem to
have no larger one in any channel."""
CLEARER = 0.8
"""Part of what the electrodes named leave that channels must leave to be named instead."""
OR_CURRENT = (
    "where driven electrodes aren't read, a channel's gain and the current injected at the same electrodes can't be "
    "told apart"
)
ONE_FRAME = "one frame: a standing error that all electrodes share can't be told from noise"


def diagnose_tank(recording: Recording, name: str, criteria: Criteria = DEFAULT) -> Findings:
    """Name the electrodes with a systematic error in the empty tank, if any stand out; map what changed later."""
    assert recording.protocol is not None
    assert recording.frames is not None
    protocol = recording.protocol
    voltage = completed(protocol, np.asarray(recording.frames.voltage_v, dtype=float))
    reason = _unusable(protocol, voltage)
    if reason:
        return refused(name, reason)
    errors = blamed(protocol, voltage[0])
    mended = voltage[0]
    for weight in errors.weights(protocol):
        mended = corrected(protocol, mended, weight)
    noise = noise_v(protocol, voltage)
    left = (channel_errors if errors.channels else electrode_errors)(protocol, mended)
    diagnosis = _instrument(name, protocol, voltage, (errors, left, mended), criteria)
    placement = placed(recording, mended, noise, errors)
    return DrawnFindings(
        diagnosis if placement is None else with_placement(diagnosis, placement, criteria),
        tests_before=(errors.axis_test(noise),),
        tests_after=(left.axis_test(noise),),
        drawings=(_electrode_drawing(errors, left), *_maps(recording, voltage)),
    )


def _instrument(
    name: str,
    protocol: Protocol,
    voltage: Array,
    found: tuple[ElectrodeErrors, ElectrodeErrors, Array],
    criteria: Criteria,
) -> Diagnosis:
    """What the instrument does: its electrodes' errors before and after the empty scan was mended."""
    errors, left, mended = found
    empty, noise = voltage[0], noise_v(protocol, voltage)
    before, after = (rms_v(protocol, scan) / noise for scan in (empty, mended))
    every = (c for k in range(len(errors.named)) for c in _claims(protocol, (empty, mended, noise), errors, k))
    capped = (replace(claim, confidence=min(claim.confidence, criteria.surest_confidence)) for claim in every)
    claims = tuple(claim for claim in capped if claim.confidence >= criteria.least_confidence)
    chance = unexplained_chance(protocol, voltage)
    if rms_v(protocol, empty) < LEAST_ERROR * _readings_rms_v(protocol, empty):
        chance = 1.0
    said = [ONE_FRAME] if len(voltage) == 1 else []
    said += [OR_CURRENT] if claims and errors.channels and not driven_are_read(protocol) else []
    verdict = verdict_of(before if chance < criteria.chance else 1.0, after, bool(claims), criteria)
    return Diagnosis(
        name,
        verdict,
        HeldOut(SPLIT, noise, before, after, min(errors.p_value, default=chance)),
        stage=None if verdict == "no_mismatch" else "acquisition",
        electrodes=errors.electrodes(protocol) if verdict != "no_mismatch" else (),
        depends_on=("electrode",) if errors.named and verdict != "no_mismatch" else (),
        claims=claims,
        unexplained_ratio=after,
        unexplained_depends_on=("electrode",) if left.named else (),
        reason="; ".join(said) or None,
    )


def _readings_rms_v(protocol: Protocol, scan_v: Array) -> float:
    return float(np.sqrt(np.mean(scan_v[protocol.taken] ** 2)))


def blamed(protocol: Protocol, scan_v: Array) -> ElectrodeErrors:
    """The electrodes, or the channels, that stand out by more than matters to nobody: whichever leave less."""
    reads = (protocol.measurement != 0).sum(axis=2)
    if reads.max() < 2 or not _always_the_same(protocol):
        return _material(protocol, scan_v, electrode_errors(protocol, scan_v))
    # Two tests share the chance of naming anything where nothing is wrong.
    electrodes = _material(protocol, scan_v, electrode_errors(protocol, scan_v, LEVEL / 2))
    channels = _material(protocol, scan_v, channel_errors(protocol, scan_v, LEVEL / 2))
    clearer = not electrodes.named or channels.left_v < CLEARER * electrodes.left_v
    found = channels if channels.named and clearer else electrodes
    return replace(found, p_value=tuple(min(2 * p, 1.0) for p in found.p_value))


def _always_the_same(protocol: Protocol) -> bool:
    """Whether a column reads the same electrodes in every injection that it is taken in."""
    weight = protocol.measurement
    first = np.take_along_axis(weight, protocol.taken.argmax(axis=0)[None, :, None], axis=0)
    return bool(((weight == first) | ~protocol.taken[:, :, None]).all())


def driven_are_read(protocol: Protocol) -> bool:
    """Whether any reading of an injection touches the electrodes that it drives."""
    touches = np.einsum("kml,kl->km", protocol.measurement != 0, protocol.injection_current_a != 0)
    return bool(touches.any())


def _material(protocol: Protocol, scan_v: Array, errors: ElectrodeErrors) -> ElectrodeErrors:
    """Those that stand out by more than a gain or an offset that matters to nobody."""
    least_v = LEAST_GAIN * _readings_rms_v(protocol, scan_v)

    def matters(weight: Array) -> bool:
        found = column_errors(protocol, scan_v, weight)
        return any(abs(c.gain) > LEAST_GAIN or abs(c.offset_v) > least_v for c in found)

    every = zip(errors.named, errors.p_value, errors.weights(protocol), strict=True)
    kept = [(e, p) for e, p, weight in every if matters(weight)]
    return replace(errors, named=tuple(e for e, _ in kept), p_value=tuple(p for _, p in kept))


def noise_v(protocol: Protocol, voltage_v: Array) -> float:
    """Noise of a reading in volt: what no network explains of how frames (T,K,M) differ, for systematic errors don't.

    With one frame alone, the usual size of what no network explains of it.
    """
    good = voltage_v[np.isfinite(voltage_v).all(axis=(1, 2))][:MOST_COMPARED]
    if len(good) > 1:
        noise = float(np.sqrt(np.mean([rms_v(protocol, change) ** 2 for change in np.diff(good, axis=0)]) / 2))
    else:
        left = unexplained_v(protocol, good[0])
        share = 1 - protocol.orthonormal.shape[1] / protocol.count
        noise = float(1.4826 * np.median(np.abs(left[protocol.taken])) / np.sqrt(share))
    return max(noise, 1e-9 * float(np.abs(good).max()))


def unexplained_chance(protocol: Protocol, voltage_v: Array) -> float:
    """Chance that noise alone makes what no network explains of the first frame as large as it is (Fisher's F).

    Degrees of freedom count less where some columns are noisier than others (Satterthwaite). NaN with one frame.
    """
    good = voltage_v[np.isfinite(voltage_v).all(axis=(1, 2))][:MOST_COMPARED]
    if len(good) < 2:
        return float("nan")
    changes = np.array([unexplained_v(protocol, change) for change in np.diff(good, axis=0)])
    column = (changes**2).mean(axis=(0, 1))
    even = float(column.mean() ** 2 / np.maximum((column**2).mean(), 1e-300))
    freedom = even * (protocol.count - protocol.orthonormal.shape[1])
    ratio = rms_v(protocol, good[0]) / noise_v(protocol, good)
    return float(f_distribution.sf(ratio**2, freedom, freedom))


def _unusable(protocol: Protocol, voltage_v: Array) -> str | None:
    """Why a recording can't say anything, if so."""
    if not len(voltage_v):
        return "the recording holds no frame"
    if not np.isfinite(voltage_v[0]).all():
        return "the first frame has readings that are no numbers"
    if not np.ptp(voltage_v[0]) > 0:
        return "all readings of the first frame are alike"
    if protocol.orthonormal.shape[1] >= protocol.count:
        return "some resistor network explains any readings of this protocol: no reading is taken twice"
    return None


def _claims(protocol: Protocol, scans: tuple[Array, Array, float], errors: ElectrodeErrors, number: int) -> list[Claim]:
    """A gain and offset for every column that reads a bad electrode, or for a bad channel.

    As sure as the electrode is, times the share of its excess over the other electrodes that they take away.
    """
    empty, mended, noise = scans
    again = channel_errors if errors.channels else electrode_errors
    named = errors.named[number]
    usual = float(np.nanmedian(errors.rms_v))
    left = float(again(protocol, mended).rms_v[named])
    excess = errors.rms_v[named] ** 2 - usual**2
    share = float(np.clip(1 - max(left**2 - usual**2, 0.0) / max(excess, 1e-300), 0.0, 1.0))
    confidence = surely(errors.p_value[number]) * share
    ratio = rms_v(protocol, empty) / noise
    return [
        Claim(_effect(column), confidence, ratio, _estimates(column))
        for column in column_errors(protocol, empty, errors.weights(protocol)[number])
    ]


def _effect(column: ColumnError) -> Effect:
    off = measured_as(Measured.CHANNEL_ERROR)()
    found = {"gain": column.gain, "offset_v": column.offset_v}
    within = {key: float(np.clip(value, off.known(key).low, off.known(key).high)) for key, value in found.items()}
    return off.changed({"channel": column.channel, **within})


def _estimates(column: ColumnError) -> dict[str, Estimate]:
    found = (("gain", column.gain, column.gain_error, "1"), ("offset_v", column.offset_v, column.offset_error_v, "V"))
    return {
        key: Estimate(value, value - QUANTILE * error, value + QUANTILE * error, unit)
        for key, value, error, unit in found
        if np.isfinite(error)
    }


def _electrode_drawing(before: ElectrodeErrors, after: ElectrodeErrors) -> Drawing:
    what = "channel" if before.channels else "electrode"
    if before.named:
        said = ", ".join(f"{e} (p = {p:.2g})" for e, p in zip(before.named, before.p_value, strict=True))
        said = f"Standing out, corrected for the number of {what}s: {said}."
    else:
        said = f"None stands out (p = {before.p_left:.2g}, named from {LEVEL:g} down)."
    caption = f"Error of each {what}'s readings that no resistor network explains. {said}"
    return f"Which {what} reads wrong", caption, lambda: electrode_figure(before, after)


def _maps(recording: Recording, voltage_v: Array) -> list[Drawing]:
    """The later frames' maps, where the tank can be meshed and a background fits."""
    later = [k for k in range(1, len(voltage_v)) if np.isfinite(voltage_v[k]).all()][:MOST_IMAGED]
    if not later:
        return []
    assert recording.sensor is not None
    assert recording.protocol is not None
    try:
        imaging = Imaging(recording.sensor, recording.protocol, voltage_v[0])
        maps = [imaging.image(voltage_v[k]) for k in later]
    except (MeshError, RuntimeError, np.linalg.LinAlgError):
        return []
    caption = (
        "Conductivity over the empty tank's, by iterated Gauss-Newton with total variation; how smooth was chosen by "
        "the readings (the bend of the L-curve)."
    )
    return [("What changed", caption, lambda: map_figure(recording.sensor, maps, later))]

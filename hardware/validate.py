"""What a recording holds and what is wrong with it: refusals, warnings and the facts a person asks for first."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.measurement import Array, Coupon, Frames, Recording, RecordingError, RigidBlock, Specimen
from ertskin.hardware.recording import read_with_state
from ertskin.hardware.uses import Use, uses_of
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor
from ertskin.physics.spikes import completed

SPIKE_SIGMAS = 5.0
"""A sample is a spike this many robust standard deviations off."""


@dataclass(frozen=True)
class Fact:
    """One thing a recording says: ``value`` as a person reads it, ``number`` in SI units where it is one."""

    name: str
    value: str
    number: float | None = None


@dataclass
class Findings:
    """``errors`` make the file unusable; ``warnings`` are worth a look before trusting it; ``facts`` describe it.

    ``uses``: what the recording can be used for, and what it lacks for the rest.
    """

    path: Path
    errors: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    facts: list[Fact] = field(default_factory=list)
    uses: list[Use] = field(default_factory=list)

    def fact(self, name: str, value: str, number: float | None = None) -> None:
        """Add a fact."""
        self.facts.append(Fact(name, value, number))

    def number(self, name: str) -> float:
        """The number of the fact named; raises ``KeyError`` where there is none."""
        for fact in self.facts:
            if fact.name == name and fact.number is not None:
                return fact.number
        raise KeyError(name)


@dataclass(frozen=True)
class RestQuality:
    """How the untouched skin reads. Volt; shares and defects are ratios.

    ``noise_v``: robust standard deviation of a reading, from what no resistor network could give in the differences of
    successive rest frames (so drifting contacts don't count). ``drift_v``: rms of the part of these differences that
    one could give, the noise taken off. ``reciprocity_defect``: rms of the irreciprocal part of the median rest frame
    over the frame's rms. ``worst_electrode`` and ``worst_factor``: the electrode whose readings hold most of that part,
    against the median electrode.
    """

    noise_v: float
    drift_v: float
    spike_share: float
    reciprocity_defect: float
    reciprocity_defect_v: float
    worst_electrode: int
    worst_factor: float


def validate(path: str | Path) -> Findings:
    """Everything to be said about the recording at ``path``; a refusal becomes an error, never an exception."""
    findings = Findings(Path(path))
    try:
        recording, unfinished = read_with_state(path)
    except RecordingError as error:
        findings.errors.append(str(error))
        return findings
    if unfinished:
        findings.warnings.append("half done: its recorder was stopped; record again to go on at the next press")
    describe(recording, findings)
    findings.uses = uses_of(recording)
    return findings


def describe(recording: Recording, findings: Findings) -> None:
    """Add the facts and warnings of a recording in memory."""
    findings.fact("rig", recording.rig or "-")
    findings.fact("created", recording.created or "-")
    if recording.comment:
        findings.fact("comment", recording.comment)
    if recording.sensor is not None:
        _describe_sensor(recording.sensor, findings)
    if recording.protocol is not None:
        _describe_protocol(recording.protocol, findings)
    if recording.frames is not None:
        _describe_frames(recording.frames, recording.sensor, recording.protocol, findings)
    if recording.specimen is not None:
        _describe_specimen(recording.specimen, findings)
    if recording.rigid_block is not None:
        _describe_rigid_block(recording.rigid_block, findings)
    if recording.coupon is not None:
        _describe_coupon(recording.coupon, findings)


def _describe_sensor(sensor: Sensor, findings: Findings) -> None:
    width, height = sensor.extent_m[1] - sensor.extent_m[0]
    findings.fact("sheet", f"{1e3 * width:.1f} x {1e3 * height:.1f} mm, {sensor.sheet_resistance_ohm_sq:g} ohm/sq")
    kind = "pads inside the sheet" if sensor.electrode_edge_m is None else "on the outline"
    findings.fact("electrodes", f"{sensor.electrodes}, {kind}", sensor.electrodes)
    findings.fact("layers", ", ".join(layer.name for layer in sensor.layers) or "none")
    findings.fact("taxels", str(len(sensor.taxel_m)), len(sensor.taxel_m))


def _describe_protocol(protocol: Protocol, findings: Findings) -> None:
    injections, readings = protocol.shape
    findings.fact("scan", f"{injections} injections x {readings} readings", injections * readings)
    if protocol.count < injections * readings:
        findings.fact("readings taken", f"{protocol.count} of {injections * readings}", protocol.count)
    combinations, pairs = protocol.factor.shape
    if combinations < pairs:
        findings.fact("pair resistances told", f"{combinations} combinations of {pairs}", combinations)
    if protocol.count == combinations:
        findings.warnings.append("no reading is taken twice: the noise can't be told from what changes on the skin")
    if protocol.injection_offset_s is None:
        findings.warnings.append("protocol has no injection_offset_s: a press that moves during a scan can't be seen")
    elif not protocol.timed:
        findings.warnings.append("injection_offset_s are all alike: a press that moves during a scan can't be seen")
    if protocol.adc_limit_v is None:
        findings.warnings.append("protocol has no adc_limit_v: saturation can't be told from a large reading")


def _describe_frames(frames: Frames, sensor: Sensor | None, protocol: Protocol | None, findings: Findings) -> None:
    history = frames.history
    findings.fact("frames", str(len(frames)), len(frames))
    findings.fact("presses", str(press_count(history)), press_count(history))
    rest = history.phase == Phase.REST
    findings.fact("rest frames", str(int(rest.sum())), int(rest.sum()))
    if len(frames) == 0:
        findings.warnings.append("no frames in /frames")
        return
    duration = float(np.ptp(history.time_s))
    findings.fact("duration", f"{duration:.1f} s", duration)
    _describe_history(history, sensor, findings)
    _warn_constant_readings(frames, findings)
    if protocol is None:
        findings.warnings.append("no /protocol: readings are numbers without a meaning in volt")
        return
    _describe_lost(frames, protocol, findings)
    _describe_saturation(frames, protocol, findings)
    _describe_rest(frames, protocol, findings)


def press_count(history: History) -> int:
    """Presses in a history: numbers borne by at least one frame that is not at rest."""
    return len(np.unique(history.press[history.phase != Phase.REST]))


def _describe_history(history: History, sensor: Sensor | None, findings: Findings) -> None:
    for name, values, scale, unit in (
        ("depth", history.depth_m, 1e3, "mm"),
        ("force", history.force_n, 1.0, "N"),
    ):
        known = values[np.isfinite(values)]
        if known.size:
            text = f"{scale * known.min():.3g} to {scale * known.max():.3g} {unit}"
            findings.fact(name, text, float(known.max()))
        else:
            findings.warnings.append(f"{name} is not known in any frame")
    step = np.diff(history.time_s)
    if (step <= 0).any():
        at = int(np.argmax(step <= 0))
        findings.warnings.append(f"time_s does not increase after frame {at} ({int((step <= 0).sum())} times)")
    if (np.diff(history.press) < 0).any():
        findings.warnings.append("press numbers run backwards")
    pressing = history.phase != Phase.REST
    placed = np.isfinite(history.contact_m).all(axis=-1).any(axis=-1)
    if (pressing & ~placed).any():
        findings.warnings.append(f"{int((pressing & ~placed).sum())} frames press at no known place")
    if not (history.phase == Phase.REST).any():
        findings.warnings.append("no rest frames: noise, drift and contact resistances can't be told at rest")
    elif history.phase[-1] != Phase.REST:
        findings.warnings.append("the last frame is not at rest: was the recording cut short?")
    if sensor is not None:
        _warn_outside(history, sensor, findings)


def _warn_outside(history: History, sensor: Sensor, findings: Findings) -> None:
    low, high = sensor.extent_m
    contact = history.contact_m[np.isfinite(history.contact_m).all(axis=-1)]
    outside = ((contact < low) | (contact > high)).any(axis=-1)
    if outside.any():
        findings.warnings.append(f"{int(outside.sum())} contacts lie outside the sheet")


def _warn_constant_readings(frames: Frames, findings: Findings) -> None:
    if len(frames) < 3:
        return
    dead = (frames.voltage_v == frames.voltage_v[0]).all(axis=0)
    if dead.any():
        findings.warnings.append(f"{int(dead.sum())} of {dead.size} readings never change")


def _describe_saturation(frames: Frames, protocol: Protocol, findings: Findings) -> None:
    if protocol.adc_limit_v is None:
        return
    share = saturated_share(frames.voltage_v, protocol)
    findings.fact("saturated", f"{100 * share:.3g} % of readings", share)
    if share > 0:
        findings.warnings.append(
            f"{100 * share:.3g} % of readings at the converter's limit of {protocol.adc_limit_v:g} V"
        )


def _describe_lost(frames: Frames, protocol: Protocol, findings: Findings) -> None:
    lost = np.isnan(frames.voltage_v[:, protocol.taken])
    if lost.any():
        share = float(lost.mean())
        findings.fact("lost", f"{100 * share:.3g} % of readings", share)
        findings.warnings.append(
            f"{100 * share:.2g} % of readings are lost (NaN), in {int(lost.any(axis=1).sum())} of {len(frames)} frames"
        )


def saturated_share(voltage_v: NDArray[np.floating], protocol: Protocol) -> float:
    """Share of readings within a step of the converter's upper limit; 0 where the limit is not known."""
    if protocol.adc_limit_v is None or voltage_v.size == 0:
        return 0.0
    step = protocol.adc_volts_per_count or 1e-6 * protocol.adc_limit_v
    return float(np.mean(voltage_v >= protocol.adc_limit_v - 1.5 * step))


def _describe_rest(frames: Frames, protocol: Protocol, findings: Findings) -> None:
    rest = completed(protocol, frames.voltage_v[frames.history.phase == Phase.REST].astype(float))
    rest = rest[np.isfinite(rest).all(axis=(1, 2))]
    if len(rest) == 0:
        return
    quality = rest_quality(rest, protocol)
    signal = float(np.sqrt(np.mean(rest[:, protocol.taken] ** 2)))
    findings.fact("signal at rest", f"{signal:.4g} V rms", signal)
    if len(rest) > 1:
        percent = 100 * quality.noise_v / signal
        findings.fact("noise at rest", f"{1e3 * quality.noise_v:.4g} mV ({percent:.3g} % of signal)", quality.noise_v)
        findings.fact("drift between rest frames", f"{1e3 * quality.drift_v:.4g} mV rms", quality.drift_v)
        findings.fact("spikes", f"{100 * quality.spike_share:.3g} % of readings at rest", quality.spike_share)
        if quality.spike_share > 1e-3:
            findings.warnings.append(f"{100 * quality.spike_share:.2g} % of readings at rest are spikes")
        if quality.drift_v > 0.02 * signal:
            findings.warnings.append(f"rest frames drift by {100 * quality.drift_v / signal:.2g} % of the signal")
    defect = quality.reciprocity_defect
    findings.fact("reciprocity defect", f"{100 * defect:.3g} % of signal", defect)
    if defect > 0.01:
        findings.warnings.append(
            f"reciprocity defect {100 * defect:.2g} %: readings no resistor network could give; most at electrode "
            f"{quality.worst_electrode} ({quality.worst_factor:.1f} times the median electrode's)"
        )


def rest_quality(rest_v: Array, protocol: Protocol) -> RestQuality:
    """Quality of complete rest frames (T,K,M) in volt, T >= 1; with one only the reciprocity defect is known (rest 0).

    Readings not taken are left aside.
    """
    taken = protocol.taken.ravel()
    basis = protocol.orthonormal[taken]
    flat = rest_v.reshape(len(rest_v), -1)[:, taken]
    middle = np.median(flat, axis=0)
    defect = middle - basis @ (basis.T @ middle)
    noise, drift, spikes = _noise(flat, basis)
    scale = float(np.sqrt(np.mean(middle**2))) or 1.0
    electrode, factor = _worst_electrode(defect, protocol)
    rms = float(np.sqrt(np.mean(defect**2)))
    return RestQuality(noise, drift, spikes, rms / scale, rms, electrode, factor)


def _noise(flat_v: Array, basis: Array) -> tuple[float, float, float]:
    """Noise (V), drift (V) and share of spikes of rest frames (T,N) of the N readings taken."""
    share = basis.shape[1] / basis.shape[0]
    if len(flat_v) < 2 or share >= 1.0:
        return 0.0, 0.0, 0.0
    step = np.diff(flat_v, axis=0) / np.sqrt(2.0)
    spike = np.zeros(step.shape, dtype=bool)
    # A spike leaks into every reading's reciprocal part: take the found ones back to that part, and look again.
    for _ in range(4):
        reciprocal = (step @ basis) @ basis.T
        left = step - reciprocal
        sigma = 1.4826 * float(np.median(np.abs(left))) / np.sqrt(1.0 - share)
        fresh = np.abs(left) > SPIKE_SIGMAS * sigma
        if sigma == 0.0 or not fresh.any():
            break
        spike |= fresh
        step = np.where(fresh, reciprocal, step)
    drift = float(np.sqrt(max(0.0, float(np.mean(reciprocal**2)) - share * sigma**2)))
    # A spike shows in the two differences around its frame.
    return sigma, drift, float(np.mean(spike)) / 2.0


def _worst_electrode(defect_v: Array, protocol: Protocol) -> tuple[int, float]:
    """The electrode whose readings hold most of a defect (N,), and how many times the median electrode's (rms)."""
    weight = np.abs(protocol.measurement)[protocol.taken]
    power = (defect_v**2) @ weight / np.maximum(weight.sum(axis=0), 1e-12)
    rms = np.sqrt(power)
    worst = int(np.argmax(rms))
    return worst, float(rms[worst] / max(float(np.median(rms)), 1e-300))


def _describe_specimen(specimen: Specimen, findings: Findings) -> None:
    cycles = len(np.unique(specimen.cycle))
    text = f"{len(specimen.stress_pa)} points, {cycles} cycles, up to {specimen.stress_pa.max():g} Pa"
    findings.fact("specimen", text, len(specimen.stress_pa))


def _describe_rigid_block(block: RigidBlock, findings: Findings) -> None:
    slope = float(np.polyfit(block.depth_m, block.force_n, 1)[0]) if len(block.depth_m) > 1 else float("nan")
    findings.fact("rigid block", f"{len(block.depth_m)} points, about {slope:.4g} N/m", slope)
    if not slope > 0:
        findings.warnings.append("the rigid block's force does not rise with depth")


def _describe_coupon(coupon: Coupon, findings: Findings) -> None:
    text = f"{len(coupon.time_s)} samples, {coupon.lateral} sides, {1e3 * coupon.height_m:.2f} mm high"
    findings.fact("coupon", text, len(coupon.time_s))

"""What a recording says, reduced for diagnosis: whitened scans, what no resistor network explains, forces, noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import DEFAULT, Criteria
from ertskin.diagnosis.recording.repeating_channels import repeating
from ertskin.diagnosis.recording.work import Work
from ertskin.hardware.recording import Recording
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor
from ertskin.physics.spikes import despiked, robust_std, tells_all

Array = NDArray[np.float64]


MOST_SPIKES = 0.01
"""Part of a channel's readings, taken for spikes, from which they are none."""
TOP = 3e-3
"""Part of the readings among which a converter that bends is looked for."""
HIGHEST = 50
"""Values at the top of the readings from which an undeclared converter's step is taken."""
MOST_USUAL = 12.0
"""Times what readings scatter by that one may usually be off and is no spike; despiking begins at five."""
FEWEST_FRAMES = 10
"""From which on what a reading is usually off by is known."""
LEAST_ODD = 1e-3
"""Part of a frame's readings, taken for spikes beyond the usual, from which the frame is odd."""
LEAST_SIGNAL = 5.0
"""Times the noise that the resting scan's numbers must have."""
FEWEST_RESTS = 4
ALIKE, OFTEN = 3.0, 0.05
"""Up to which a reading taken for a spike may be one: times what it is usually off by, and part of the frames."""
FEWEST_SHORT, LARGE, FLAT, SURELY = 2, 0.1, 0.2, 3.0
"""A converter that bends softly: fewest readings short in most rest frames, part of the readings, the largest,
among which they lie, least part by which they differ of what they should differ by, and above it by how many standard
errors: two may be as large as one another, and differ by noise alone."""
FARTHEST_ERRORS = 4.0
"""Standard deviations of chance, beyond which a change between rest frames is an outlier."""
TWIN, SPIKE = 0.5, 5.0
"""Freedom of a reading whose number one other alone tells; times a reading's usual scatter from which on it is a
spike."""
ROUNDING = 1e-12
"""Part of the largest reading that is nothing: what is left of one whose only twin is left out."""
LEAST_FREEDOM = 0.05
"""Readings that a network follows more closely than this say nothing about the noise."""
MOST_ALIKE = 0.9
"""Part of the spikes of one channel that fall short, and of these that have one value, from which on it has a limit."""


class CannotTell(Exception):
    """The recording can't answer the question; the message says why."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """T frames reduced.

    ``scan_v`` (T,P) whitened scans, spikes left out; ``leftover_v`` (T,K,M) what no resistor network gives, zero at
    spikes; ``leftover_noise_v`` noise of a reading by what no network explains,
    ``noise_v`` the same of a whitened scan's numbers: equal unless the noise is coloured; ``air_n`` of the load cell;
    ``leftover_share`` part of white noise's variance that no network explains, over the readings there are;
    ``leftover_error`` standard error of the noise by what no network explains, over itself.
    ``repeats`` (M,) number of frames in which a channel repeats its last readings, which are left out there.
    ``excess_noise`` (P,k): directions, one standard deviation long in units of the noise, in which rest frames scatter
    more; ``traces`` (T,P,m): orthonormal directions, or noughts, that say nothing: places pressed before and not
    recovered.
    ``criteria``: what is decided by, wherever the evidence goes. ``seen_at_rest``: name of the effect that rest frames
    by themselves clearly show, if one. ``work``: what fits to any frames of the recording have taken, counted together.
    """

    sensor: Sensor
    protocol: Protocol
    history: History
    scan_v: Array
    leftover_v: NDArray[np.float32]
    noise_v: float
    leftover_noise_v: float
    air_n: float
    saturated_v: float | None
    excess_noise: Array
    traces: Array
    leftover_share: float
    repeats: NDArray[np.intp]
    criteria: Criteria = DEFAULT
    leftover_error: float = 0.0
    seen_at_rest: str | None = None
    work: Work = field(default_factory=Work)

    def frames(self, rows: NDArray[np.intp]) -> Evidence:
        """The evidence of some frames."""
        return replace(
            self,
            history=self.history[rows],
            scan_v=self.scan_v[rows],
            leftover_v=self.leftover_v[rows],
            traces=self.traces[rows],
        )

    def discounted(self, rows: Array) -> Array:
        """Rows (T,P,...) in units of the noise without ``traces``, times (I + S S')^-1/2, S being ``excess_noise``."""
        if self.traces.shape[2]:
            along = np.einsum("tp...,tpm->tm...", rows, self.traces)
            rows = rows - np.einsum("tm...,tpm->tp...", along, self.traces)
        if not self.excess_noise.shape[1]:
            return rows
        axes, size, _ = np.linalg.svd(self.excess_noise, full_matrices=False)
        less = 1 - 1 / np.sqrt(1 + size**2)
        along = np.einsum("tp...,pk->tk...", rows, axes * less)
        return np.asarray(rows - np.einsum("tk...,pk->tp...", along, axes))

    @property
    def traces_factor(self) -> Array:
        """(T,) root of a scan's numbers over those that ``traces`` leave."""
        width = self.scan_v.shape[1]
        return np.sqrt(width / (width - self.traces.any(axis=1).sum(axis=1)))

    @property
    def leftover_ratio(self) -> float:
        """Rms over noise of what no network explains."""
        seen = self.leftover_v[self.leftover_v != 0]
        noise_v = np.sqrt(self.leftover_share) * self.leftover_noise_v
        return float(np.sqrt(np.mean(np.square(seen, dtype=float)))) / noise_v if seen.size else 0.0

    @property
    def rest(self) -> NDArray[np.bool_]:
        """(T,) frames in which nothing touches."""
        return np.asarray(self.history.phase == Phase.REST)


def gather(recording: Recording, criteria: Criteria = DEFAULT) -> Evidence:
    """Reduce a recording; raises ``CannotTell`` where it lacks what any answer needs."""
    history, protocol, sensor, voltage = _complete(recording)
    rest = np.asarray(history.phase == Phase.REST)
    # An electrode read against itself gives nought in every scan.
    repeats = repeating(np.where(protocol.measurement.any(axis=-1), voltage, np.nan), criteria)
    voltage[np.broadcast_to(repeats[:, None], voltage.shape)] = np.nan
    limit = _without_saturated(voltage, protocol)
    determined = _determined(protocol, np.isnan(voltage))
    if not determined[rest].any():
        raise CannotTell(_what_is_lost(protocol, voltage[rest]))
    scan, spike, bent = _scans(protocol, voltage, rest, limit is not None)
    fitted = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    if limit is None and bent:
        limit = _bent_level_v(voltage, fitted, spike)
    leftover = _leftover(voltage, fitted, spike)
    freedom = leftover_freedom(protocol, np.isfinite(voltage).mean(axis=0) > 0.5)
    noise_v = _noise_v(protocol, scan, leftover / np.sqrt(np.maximum(freedom, LEAST_FREEDOM)), spike, rest)
    scan[~determined | (spike[:, protocol.taken].mean(axis=1) >= 0.5)] = np.nan
    if not np.sqrt((np.nanmean(scan[rest], axis=0) ** 2).mean()) > LEAST_SIGNAL * noise_v:
        raise CannotTell("the readings at rest are hardly more than noise: check wiring, injected currents and units")
    force = history.force_n[rest]
    quantised_v = max(noise_v, (protocol.adc_volts_per_count or 0.0) / np.sqrt(12))
    return Evidence(
        sensor,
        protocol,
        history,
        scan,
        leftover.astype(np.float32),
        quantised_v,
        quantised_v,
        float(np.nanstd(force)) if np.isfinite(force).sum() > 3 else float("nan"),
        limit,
        np.zeros((scan.shape[1], 0)),
        np.zeros((*scan.shape, 0)),
        _leftover_share(freedom),
        repeats.sum(axis=0),
        criteria,
        _noise_error(int(rest.sum()), float(freedom.sum()) if protocol.count > scan.shape[1] else scan.shape[1]),
    )


def _complete(recording: Recording) -> tuple[History, Protocol, Sensor, Array]:
    """The parts that no answer goes without, and a copy of the readings; ``CannotTell`` where one is lacking."""
    if recording.frames is None or recording.sensor is None or recording.protocol is None:
        raise CannotTell("no frames with a sensor and a protocol: nothing to compare a skin's simulator with")
    history, protocol = recording.frames.history, recording.protocol
    if not len(history):
        raise CannotTell("no frames: the recording ended before its first scan")
    if not history.contact_m.shape[1]:
        raise CannotTell("frames name no contacts: where the skin was pressed is unknown")
    voltage = np.array(recording.frames.voltage_v, dtype=float)
    if not np.isfinite(voltage).any():
        raise CannotTell("no reading is a number")
    rest = history.phase == Phase.REST
    if not rest.any():
        raise CannotTell("no rest frames: neither the noise nor the unloaded skin is known")
    whole = np.isfinite(voltage)[:, protocol.taken].mean(axis=1) > 0.5
    if not whole[rest].any():
        raise CannotTell("every rest frame is damaged")
    # Drifts count from the first frame, whatever clock the recording keeps.
    return replace(history, time_s=history.time_s - history.time_s[0]), protocol, recording.sensor, voltage


def _without_saturated(voltage: Array, protocol: Protocol) -> float | None:
    """The converter's limit in volt, if readings (T,K,M) pile up there; those are taken out of them."""
    limit = _saturation(voltage, protocol)
    if limit is not None:
        pinned = np.abs(voltage - limit) < 1e-9 + 2 * (protocol.adc_volts_per_count or 0.0)
        if pinned.mean() > 0.5:
            raise CannotTell(f"{pinned.mean():.0%} of the readings sit at {limit:.4g} V: the converter is saturated")
        voltage[pinned] = np.nan
    return limit


def _what_is_lost(protocol: Protocol, resting_v: Array) -> str:
    """Why readings at rest (R,K,M) tell too little."""
    lost = np.isnan(resting_v) & protocol.measurement.any(axis=-1)
    worst = int(lost.sum(axis=(0, 1)).argmax())
    return (
        f"the {lost.mean():.0%} of the readings at rest that are missing, repeated or at the converter's limit"
        f" leave pair resistances undetermined; most of them are channel {worst}'s"
    )


def _scans(
    protocol: Protocol, voltage: Array, rest: NDArray[np.bool_], saturated: bool
) -> tuple[Array, NDArray[np.bool_], bool]:
    """Scans (T,P), spikes among the readings (T,K,M), and whether the converter bends at the top of its range."""
    scan, spike = despiked(protocol, voltage)
    found = scan, spike
    scan, spike = _channels_restored(protocol, voltage, *found)
    fitted = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    if not _bent_at_top(voltage, fitted, spike):
        # Of a converter that limits no other channel nothing would be said: its error stands.
        scan, spike = _channels_restored(protocol, voltage, *found, limited=False)
        fitted = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    if not saturated and _compressed(voltage, fitted, spike, rest):
        scan, spike = _usual_restored(protocol, voltage, fitted, spike, np.inf, OFTEN)
        fitted, bent = (scan @ protocol.orthonormal.T).reshape(voltage.shape), False
    else:
        bent = _bent_at_top(voltage, fitted, spike)
        if not (bent or saturated) and len(voltage) >= FEWEST_FRAMES:
            scan, spike = _usual_restored(protocol, voltage, fitted, spike, MOST_USUAL)
            scan, spike = _twins_restored(protocol, voltage, fitted, spike)
    straight: Array | None = voltage
    if bent or saturated:
        bent_v = _bent_from(fitted[rest][:, protocol.taken], spike[rest][:, protocol.taken])
        if bent and np.isfinite(bent_v):
            # Under a press a reading may lie between those that bend at rest and where they bend to.
            bent_v = min(bent_v, _bent_level_v(voltage, fitted, spike))
        straight = np.where(fitted < bent_v, voltage, np.nan) if np.isfinite(bent_v) else None
    if straight is not None:
        scan, spike = _presses_restored(protocol, straight, scan, spike, rest)
    return scan, spike, bent


def _leftover(voltage: Array, fitted: Array, spike: NDArray[np.bool_]) -> Array:
    """(T,K,M) what no network explains of the readings, in volt; nought where that says nothing."""
    found = np.where(spike | ~np.isfinite(voltage), 0.0, voltage - fitted)
    return np.where(np.abs(found) > ROUNDING * np.abs(fitted).max(), found, 0.0)


def _noise_v(
    protocol: Protocol, scan: Array, leftover: Array, spike: NDArray[np.bool_], rest: NDArray[np.bool_]
) -> float:
    """Noise of a reading; raises ``CannotTell`` where there is none."""
    if protocol.count > scan.shape[1]:
        noise_v = _leftover_noise_v(leftover, spike, rest)
    else:
        # No reading is taken twice: any scan is explained, and the noise is how scans differ at rest.
        noise_v = _changing_v(np.diff(scan[rest], axis=0))
    if not noise_v > 0:
        raise CannotTell("the readings don't vary: no noise to measure a misfit against")
    return noise_v


def _determined(protocol: Protocol, missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T,) whether the readings that aren't ``missing`` (T,K,M) tell all that the scan can tell.

    An electrode that is never the sink, say, is known by its own channel alone, where it is the source.
    """
    patterns, of = np.unique(missing.reshape(len(missing), -1), axis=0, return_inverse=True)
    held = np.array([tells_all(protocol.orthonormal, pattern) for pattern in patterns])
    return held[of.ravel()]


def leftover_freedom(protocol: Protocol, present: NDArray[np.bool_]) -> Array:
    """(K,M) part of a reading's noise variance that a network's fit leaves, where only some readings are ``present``.

    A dead channel leaves some pairs to few readings, which the fit then follows closely.
    """
    kept = protocol.orthonormal[present.ravel()]
    inverse = np.linalg.pinv(kept.T @ kept, rcond=1e-9, hermitian=True)
    freedom = np.zeros(present.size)
    freedom[present.ravel()] = 1 - ((kept @ inverse) * kept).sum(axis=1)
    return freedom.reshape(present.shape)


def _channels_restored(
    protocol: Protocol, voltage: Array, scan: Array, spike: NDArray[np.bool_], limited: bool = True
) -> tuple[Array, NDArray[np.bool_]]:
    """Scans and spikes with whole channels put back that despiking took for spikes: an error of theirs stands.

    Of a converter that is ``limited`` what stops at one value where it should go on is no error of a channel, though
    one alone may read as much.
    """
    present = np.isfinite(voltage)
    share = (spike & present).mean(axis=(0, 1))
    systematic = (share > MOST_SPIKES) & (share > 10 * np.median(share))
    if not systematic.any():
        return scan, spike
    fitted = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    kept = spike.copy()
    for channel in np.flatnonzero(systematic):
        one = voltage[..., channel], fitted[..., channel], spike[..., channel]
        kept[..., channel] = ~present[..., channel] | (_stopped(*one) if limited else False)
    return _scans_without(protocol, voltage, fitted, kept | ~present), kept


def _stopped(voltage: Array, fitted: Array, spike: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T,K) readings of one channel at the top of its range that fall short of what they should be, where all such have
    one value and noise, and none is too large: a channel that is stuck is both."""
    known = np.isfinite(voltage) & np.isfinite(fitted)
    short = spike & known & (voltage < fitted)
    straight = known & ~spike
    if short.sum() < max(FEWEST_SHORT, MOST_ALIKE * (spike & known).sum()) or not straight.any():
        return np.zeros_like(short)
    scatter = robust_std((voltage - fitted)[straight])
    alike = np.abs(voltage - np.median(voltage[short])) < SPIKE * scatter
    differ = float(fitted[short].std()) > SPIKE * scatter
    return short & alike if differ and alike[short].mean() > MOST_ALIKE else np.zeros_like(short)


def _compressed(voltage: Array, fitted: Array, spike: NDArray[np.bool_], rest: NDArray[np.bool_]) -> bool:
    """Whether large readings fall short, frame after frame, by what grows with their size, and yet grow themselves.

    That is an amplifier that bends softly; where they stop growing it is a limit.
    """
    seen, present = fitted[rest], np.isfinite(voltage[rest])
    taken = present.any(axis=0)
    off = spike[rest].mean(axis=0) > 0.5
    whole = present[:, off].all(axis=1)
    if off.sum() < FEWEST_SHORT or not whole.any():
        return False
    size, read = np.abs(seen[whole][:, off]), (voltage[rest] * np.sign(seen))[whole][:, off]
    large = np.median(size) > np.quantile(np.abs(seen[whole][:, taken]), 1 - LARGE)
    if not large or not (read < size).mean() > 0.8:
        return False
    spread, grown = size - size.mean(), read - read.mean()
    square = (spread**2).sum()
    if not square > 0:
        return False
    slope = (spread * grown).sum() / square
    error = (grown - slope * spread).std() / np.sqrt(square)
    return bool(slope - SURELY * error > FLAT)


def _usual_restored(
    protocol: Protocol,
    voltage: Array,
    fitted: Array,
    spike: NDArray[np.bool_],
    largest: float,
    often: float = np.inf,
) -> tuple[Array, NDArray[np.bool_]]:
    """Scans and spikes with readings put back that are off by about as much in all frames, up to ``largest`` times what
    readings scatter by, or spikes in the part ``often`` of the frames: an error that stands.

    One about as large as what is taken for a spike would be left out in some frames and not in others. A reading that
    is plainly wrong stays left out.
    """
    present = np.isfinite(voltage)
    off = np.where(present, voltage - fitted, 0.0)
    usual = np.median(off, axis=0)
    near = np.abs(usual) < largest * robust_std(off[present & ~spike])
    alike = (off * usual > 0) & (np.abs(off) < ALIKE * np.abs(usual)) & near
    kept = (spike & ~alike & (spike.mean(axis=0) < often)) | ~present
    return _scans_without(protocol, voltage, fitted, kept), kept


def _twins_restored(
    protocol: Protocol, voltage: Array, fitted: Array, spike: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """Scans and spikes with readings put back whose number one other alone tells, unless they differ from it otherwise
    than they usually do: by as much, or by as much of the reading.

    Nothing says which of the two is wrong, however far apart they are: left out would be now the one, now the other,
    and now none, and what a wrong gain or offset makes of them would jump from frame to frame.
    """
    present = np.isfinite(voltage)
    freedom = leftover_freedom(protocol, present.mean(axis=0) > 0.5)
    twin = present & (np.abs(freedom - TWIN) < 1e-6)
    filled = np.where((spike & ~twin) | ~present, fitted, voltage)
    scan = filled.reshape(len(filled), -1) @ protocol.orthonormal
    projected = (scan @ protocol.orthonormal.T).reshape(voltage.shape)
    usual, level = np.median(filled - projected, axis=0), np.median(projected, axis=0)
    change = filled - projected - usual
    grown = usual * (projected / np.where(level == 0, np.inf, level) - (level != 0))
    scatter = np.maximum(robust_std(change, axis=0), robust_std(change[present & ~spike]))
    odd = np.minimum(np.abs(change), np.abs(change - grown)) > SPIKE * scatter
    kept = spike & ~(twin & ~odd)
    return _scans_without(protocol, voltage, fitted, kept), kept


def _scans_without(protocol: Protocol, voltage: Array, fitted: Array, left_out: NDArray[np.bool_]) -> Array:
    """Scans (T,P) of readings (T,K,M), those ``left_out`` as ``fitted``."""
    return np.asarray(np.where(left_out, fitted, voltage).reshape(len(voltage), -1) @ protocol.orthonormal)


def _presses_restored(
    protocol: Protocol, voltage: Array, scan: Array, spike: NDArray[np.bool_], rest: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """Scans and spikes with whole frames put back that despiking thinned out though only presses have such spikes.

    Spikes don't wait for a press; a press that moves during its scan leaves readings that no one network gives. What a
    converter bends isn't among ``voltage``.
    """
    present = np.isfinite(voltage)
    rate = (spike & present).mean(axis=(1, 2))
    usual = float(rate[rest].mean())
    odd = rate > usual + 5 * np.sqrt(usual / spike[0].size) + LEAST_ODD
    if rest.all() or odd[~rest].mean() < MOST_SPIKES or odd[rest].mean() > 0.25 * odd[~rest].mean():
        return scan, spike
    scan, spike = scan.copy(), spike.copy()
    scan[odd], spike[odd] = despiked(protocol, voltage[odd], threshold=np.inf)
    return scan, spike


def _bent_from(fitted: Array, spike: NDArray[np.bool_]) -> float:
    """Voltage from which on a converter bends at rest: there more readings are taken for spikes than below."""
    order = np.argsort(fitted, axis=None)[::-1]
    odd = spike.ravel()[order]
    # Counted down from the top, the readings that are bent more often than not.
    excess = np.cumsum(np.where(odd, 1, -1))
    return float(fitted.ravel()[order[excess.argmax()]]) if excess.max() > 0 else np.inf


def _bent_at_top(voltage: Array, fitted: Array, spike: NDArray[np.bool_]) -> bool:
    """Whether the largest readings fall short of what the others say they should be, and only those.

    All of them: a channel whose gain is too low falls short where its readings are large, and others don't. What is
    usual is counted below where they fall short: a source's own reading at the limit may be a part of every scan.
    """
    known = np.isfinite(fitted) & np.isfinite(voltage)
    top = known & (fitted > np.quantile(fitted[known], 1 - TOP))
    below = known & (fitted < _bent_from(fitted[known], spike[known]))
    share = float(spike[top].mean())
    if share < MOST_SPIKES or not below.any() or share < 20 * float(spike[below].mean()):
        return False
    as_large = top & (fitted >= np.median(fitted[top & spike]))
    if spike[as_large].mean() < 0.5:
        return False
    return bool((voltage < fitted)[top & spike].mean() > 0.9)


def _bent_level_v(voltage: Array, fitted: Array, spike: NDArray[np.bool_]) -> float:
    """Voltage at which a converter bends: where noise comes after it, the largest reading lies far above.

    The middle of the readings that fall short, of the largest there should be.
    """
    known = np.isfinite(fitted) & np.isfinite(voltage)
    short = known & spike & (voltage < fitted) & (fitted > np.quantile(fitted[known], 1 - TOP))
    return float(np.median(voltage[short])) if short.any() else float(np.nanmax(voltage))


def _leftover_noise_v(leftover: Array, spike: NDArray[np.bool_], rest: NDArray[np.bool_]) -> float:
    """Noise of what no network explains, from how it changes between rest frames: a systematic error is no noise."""
    if rest.sum() < FEWEST_RESTS:
        return float(robust_std(leftover[~spike]))
    change = np.diff(leftover[rest], axis=0)
    return _changing_v(change[~(spike[rest][1:] | spike[rest][:-1])])


def _changing_v(change: Array) -> float:
    """Noise by how numbers ``change`` from one rest frame to the next.

    As precise as the rms is where few are beyond what noise does, and as deaf to outliers as the median.
    """
    if not change.size:
        return 0.0
    usual = change[np.abs(change) < FARTHEST_ERRORS * robust_std(change)]
    return float(np.sqrt(np.mean(np.square(usual, dtype=float)))) / np.sqrt(2) if usual.size else 0.0


def _leftover_share(freedom: Array) -> float:
    """Mean over the readings that say something about the noise; one where there are none."""
    seen = freedom[freedom > LEAST_FREEDOM]
    return float(seen.mean()) if seen.size else 1.0


def _noise_error(rests: int, freedom: float) -> float:
    """Relative standard error of white noise by first differences of so many rest frames, in which ``freedom`` numbers
    each tell of it (J. von Neumann and others, Ann. Math. Stat. 12 (1941) 153)."""
    if rests < FEWEST_RESTS or freedom <= 0:
        return 0.0
    return 0.5 * float(np.sqrt((3 * rests - 4) / ((rests - 1) ** 2 * freedom)))


def _step_at_top(finite_v: Array) -> float:
    """The smallest difference of the largest values there are: the converter's step, where it is a coarse one."""
    top = np.unique(finite_v)[-HIGHEST:]
    return max(float(np.diff(top).min()), 1e-9) if len(top) > 1 else 1e-9


def _saturation(voltage_v: Array, protocol: Protocol) -> float | None:
    """The value at which readings pile up at the top of their range, if they do."""
    finite = voltage_v[np.isfinite(voltage_v)]
    top = float(finite.max())
    step = protocol.adc_volts_per_count or _step_at_top(finite)
    piled = int((finite > top - 0.5 * step).sum())
    below = int(((finite <= top - 0.5 * step) & (finite > top - 50 * step)).sum())
    return top if piled > 20 and piled > 3 * max(below, 1) else None

"""What the frames at rest say: contact and sheet resistances, the noise, and which contacts wander."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.linear.calibration_vector import CONTACT_SPREAD
from ertskin.diagnosis.linear.sensitivity import sheet_sensitivity, whitening_of_transfer
from ertskin.diagnosis.recording.evidence import Evidence
from ertskin.diagnosis.rest.settling_contacts import NONE_SETTLES, Settling, settling_contacts
from ertskin.diagnosis.rest.wandering_contacts import ENOUGH_RESTS, Drifting, contact_drift, each_moved
from ertskin.diagnosis.rest.warmth import RestWarmth, warmth_at_rest
from ertskin.physics.history import History
from ertskin.physics.sensor import Sensor
from ertskin.physics.skin import TAIL, Skin

Array = NDArray[np.float64]

ROUNDS = 30
LEAST_GUESS_OHM = 10.0
"""Least that a file's guess of a contact's resistance counts as: it begins a fit in logarithms, and may be nought."""
FAR_FROM_GUESS = 5.0
"""Logarithm of most contacts' resistance, over what a sensor's file guesses, from which on they are drawn back: 500
ohm where a file guesses 10 are common, but 50,000 are what a misfit makes of readings without driven electrodes
(c012 of ``tenth16``)."""
REMEMBERED = 3
"""Places, pressed before a rest frame, that may not have recovered yet."""
COLOURED = 0.05
"""Excess of the rest frames' scatter over the readings' noise that is taken for coloured noise."""
SURELY_COLOURED = 3.0
"""Its own standard errors from which on no contact is held to be loose for it: few frames of a small skin scatter as
much by chance."""
ALONG = 0.8
"""Cosine between what is seen of a jittering contact and what it would do."""
STANDS_OUT = 3.0
"""Times the median from which one of many is the one that is wrong: a contact by the share of its resistance by which
it jitters, a channel by its systematic error."""
SURELY = 5.0
"""Standard deviations of chance above which places are taken not to have recovered."""
CHANCES, RARELY = 400, 0.01
"""Simulated recordings of white noise, and how rarely one of them may be taken for more."""


@dataclass(frozen=True, eq=False)
class Rested:
    """``skin`` calibrated to the mean resting scan ``scan_v`` (P,) with noise ``scan_noise_v``, which left ``misfit``.

    ``drifting`` contacts that wander, with what all have besides; ``noise`` of whitened scans; ``traces`` (T,P,m) what
    the evidence leaves out; ``warmth`` name of the effect that warms the sheet, if the frames clearly show one.
    """

    skin: Skin
    scan_v: Array
    scan_noise_v: float
    misfit: float
    drifting: Drifting
    noise: Noise
    traces: Array
    warmth: str | None


def rested(skin: Skin, evidence: Evidence) -> Rested:
    """What the frames at rest say of a skin."""
    good = evidence.rest & np.isfinite(evidence.scan_v).all(axis=1)
    scans = evidence.scan_v[good]
    first, columns, _ = fitted_at_rest(skin, scans.mean(axis=0))
    every = imprints(first, evidence.history)
    warmth, settling = _warmth(first, evidence, good, columns, every[good])
    scans = scans - warmth.change_v
    traces = _needed(every[good], scans - scans.mean(axis=0), columns, evidence.noise_v)
    mean = _undisturbed_mean(scans, columns, traces)
    skin, columns, scan = fitted_at_rest(first, mean)
    mean_noise_v = float(evidence.noise_v / np.sqrt(len(scans)))
    misfit = float(np.sqrt(np.mean(((mean - scan) / mean_noise_v) ** 2)))
    clean = scans - _shares(scans - mean, columns, traces)[1]
    time_s, contacts = evidence.history.time_s[good], skin.contact_resistance_ohm
    run = np.cumsum(~evidence.rest, dtype=np.intp)[good]
    criteria, doubt = evidence.criteria, warmth.doubt
    given = evidence.noise_v, columns, traces, contacts, criteria, partial(_scan_at_rest, skin), doubt, settling
    drifting = contact_drift(scans - mean, time_s, run, *given)
    noise = _scatter(clean, run, columns, (evidence.noise_v, evidence.leftover_error), criteria)
    left_out = every[..., : traces.shape[2]]
    return Rested(skin, mean, mean_noise_v, misfit, drifting, noise, left_out, warmth.name)


def _warmth(
    skin: Skin, evidence: Evidence, good: NDArray[np.bool_], columns: Array, traces: Array
) -> tuple[RestWarmth, Settling]:
    """What warms the sheet by the rest frames ``good`` (T,), and the contacts that settle where it is seen in what they
    leave, none where it is seen by itself.

    What one number explains isn't left for a contact each and places that recover. A scan warms the sheet next to the
    pads, as if contacts changed there; beside some that do settle it is told by all the others.
    """
    scans = evidence.scan_v[good]
    change = scans - scans.mean(axis=0)
    warmth = warmth_at_rest(skin, evidence, good, change, columns[:, -1])
    settling = _settling(change, evidence, good, columns, traces)
    if warmth.name is not None and warmth.uneven >= settling.explained:
        return warmth, NONE_SETTLES
    warmth = RestWarmth.none_in(change)
    if settling.size:
        warmth = warmth_at_rest(skin, evidence, good, change - settling.done(columns), columns[:, -1])
    return warmth._replace(change_v=warmth.whole_v), settling if warmth.name is not None else NONE_SETTLES


def _settling(change: Array, evidence: Evidence, good: NDArray[np.bool_], columns: Array, traces: Array) -> Settling:
    """The contacts that settle by the changes (R,P) of the rest frames ``good``; none where places that recover
    (``traces``) are seen."""
    if len(change) < ENOUGH_RESTS or _needed(traces, change, columns, evidence.noise_v).any():
        return NONE_SETTLES
    designs = [columns / evidence.noise_v] * len(change)
    return settling_contacts(change / evidence.noise_v, designs, evidence.history.time_s[good])


def guessed_ohm(sensor: Sensor) -> float:
    """What a sensor's file guesses of a contact's resistance, where that is one."""
    return max(sensor.contact_resistance_guess_ohm, LEAST_GUESS_OHM)


def fitted_at_rest(skin: Skin, mean: Array) -> tuple[Skin, Array, Array]:
    """Contact and sheet resistances by Gauss-Newton in logarithms from a resting scan (P,).

    The skin with them, the scan's derivatives (P,L+1) by the logarithms, the sheet's last, and its own scan (P,).
    """
    contacts, zero = np.array(skin.contact_resistance_ohm), skin.piezo.zero_ohm_sq
    guess = float(np.log(guessed_ohm(skin.sensor)))
    for _ in range(ROUNDS):
        scan, slope = _scan_at_rest(replace(skin, piezo=skin.piezo.scaled(zero)), contacts)
        columns = np.column_stack([slope, scan - slope.sum(axis=1)])
        step = _step_at_rest(columns, mean - scan, np.log(contacts), guess)
        contacts = np.clip(contacts * np.exp(np.clip(step[:-1], -1.5, 1.5)), 0.1, 1e7)
        zero = zero * float(np.exp(np.clip(step[-1], -0.3, 0.3)))
        if np.abs(step).max() < 1e-6:
            break
    return replace(skin, piezo=skin.piezo.scaled(zero), contact_resistance_ohm=contacts), columns, scan


def _scan_at_rest(skin: Skin, contacts: Array) -> tuple[Array, Array]:
    """The resting scan (P,) of contacts (L,) in ohm, and its derivatives (P,L) by their logarithms."""
    solution = skin.sheet.solve(skin.sheet.uniform(skin.piezo.zero_ohm_sq), contacts)
    slope = skin.protocol.whitened(solution.jacobian_contact_resistance().T).T
    return skin.protocol.whitened(solution.pair_resistance_ohm), slope * contacts


def _step_at_rest(columns: Array, residual: Array, log_contacts: Array, guess: float) -> Array:
    """(L+1,) Gauss-Newton's step. Contacts that the scan hardly tells, as where driven electrodes aren't read, stay
    with most of the others, or with what comes next to these in reach of the logarithm that is guessed: else they would
    go wherever a misfit takes them."""
    numbers, contacts = len(residual), len(log_contacts)
    share = np.sqrt(residual @ residual / max(1, numbers - contacts - 1)) / CONTACT_SPREAD
    usual = np.clip(np.median(log_contacts), guess - FAR_FROM_GUESS, guess + FAR_FROM_GUESS)
    pull = share * np.eye(contacts, contacts + 1)
    wanted = np.concatenate([residual, share * (usual - log_contacts)])
    return np.asarray(np.linalg.lstsq(np.vstack([columns, pull]), wanted, rcond=None)[0])


# places that have not recovered ----------------------------------------------------------------------------------


def imprints(skin: Skin, history: History) -> Array:
    """(T,P,REMEMBERED) orthonormal, or noughts: what places pressed last before a frame change, not yet recovered.

    A place that creeps changes the readings of the electrodes next to it much as their contacts would. The place
    pressed in the frame itself isn't among them: what it does is the skin's to explain.
    """
    places, at = _places(history)
    found = np.zeros((len(at), skin.protocol.orthonormal.shape[1], REMEMBERED))
    if not len(places):
        return found
    points = skin.sheet.quadrature_m.reshape(-1, 2)
    reach = skin.pressure.radius_m(TAIL)
    pressed = np.zeros((len(places), len(points)))
    for k, place in enumerate(places):
        near = np.flatnonzero(((points - place) ** 2).sum(axis=1) < reach**2)
        pressed[k, near] = skin.pressure.at(points[near] - place)
    elements = np.arange(len(skin.sheet.weight_m2))
    scale = np.full(len(points), 1.0 / skin.piezo.zero_ohm_sq)
    whitening, isotropic = whitening_of_transfer(skin.protocol), np.array([[1.0, 0.0, 1.0]])
    solution = skin.sheet.solve(skin.sheet.uniform(skin.piezo.zero_ohm_sq), skin.contact_resistance_ohm)
    columns = sheet_sensitivity(solution, elements, csr_array(pressed), whitening, isotropic, scale)[0].astype(float)
    latest: list[int] = []
    for t, place in enumerate(at):
        before = [p for p in latest if p != place][:REMEMBERED]
        found[t, :, : len(before)] = np.linalg.qr(columns[:, before])[0]
        if place >= 0:
            latest = [int(place), *(p for p in latest if p != place)][: REMEMBERED + 1]
    return found


def _places(history: History) -> tuple[Array, NDArray[np.intp]]:
    """Places pressed (K,2), and which one in each frame (T,), -1 for none; of several contacts the first."""
    place = history.contact_m[:, 0]
    touched = history.touched[:, 0] & np.isfinite(place).all(axis=1)
    at = np.full(len(place), -1, dtype=np.intp)
    places, at[touched] = np.unique(np.round(place[touched], 4), axis=0, return_inverse=True)
    return places, at


def _needed(traces: Array, change: Array, columns: Array, noise_v: float) -> Array:
    """The traces (R,P,m), or (R,P,0) where they explain no more of the changes (R,P) than chance would."""
    none = traces[..., :0]
    left = [float(((change - sum(_shares(change, columns, t))) ** 2).sum()) / noise_v**2 for t in (none, traces)]
    freedom = int(traces.any(axis=1).sum())
    return traces if left[0] - left[1] > freedom + SURELY * np.sqrt(2 * max(freedom, 1)) else none


def _undisturbed_mean(scans: Array, columns: Array, traces: Array) -> Array:
    """(P,) mean of the rest frames (R,P), each counted in the directions its ``traces`` leave alone.

    What contacts and the whole sheet do from frame to frame is levelled first, each to where the frames that tell it
    well have it: next to a place not yet recovered a frame hardly tells a contact.
    """
    share, error = each_moved(scans - scans.mean(axis=0), 1.0, columns, traces)
    usual = (share / error**2).sum(axis=0) / (error**-2).sum(axis=0)
    level = scans - (share - usual) @ columns.T
    free = [np.eye(scans.shape[1]) - trace @ trace.T for trace in traces]
    total = np.einsum("rpq,rq->p", free, level, optimize=True)
    return np.asarray(np.linalg.lstsq(np.sum(free, axis=0), total, rcond=1e-6)[0])


def _shares(change: Array, columns: Array, traces: Array) -> tuple[Array, Array]:
    """(R,P), (R,P) parts of the changes (R,P) that contacts and sheet explain, and places not yet recovered."""
    own, place = np.zeros_like(change), np.zeros_like(change)
    for row, trace in enumerate(traces):
        both = np.linalg.lstsq(np.hstack([columns, trace]), change[row], rcond=None)[0]
        own[row], place[row] = columns @ both[: columns.shape[1]], trace @ both[columns.shape[1] :]
    return own, place


# noise -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Noise:
    """``rms_v`` of a whitened scan's numbers, its standard error over itself, and ``excess_noise`` (P,k): directions
    in which rest frames scatter more than that.

    ``jittering`` electrode whose contact alone makes white noise scatter materially more; -1 if there is none.
    """

    rms_v: float
    error: float
    excess_noise: Array
    jittering: int = -1


def _scatter(
    scans: Array, run: NDArray[np.intp], columns: Array, reading: tuple[float, float], criteria: Criteria
) -> Noise:
    """The noise of rest frames (R,P), of which ``run`` (R,) numbers the runs between presses, from a ``reading``'s and
    its standard error over itself.

    From second differences of the rest frames, in which a steady drift is nothing. Coloured noise weighs more in the
    scans than in what no network explains; contacts that jitter do so along their ``columns`` (P,n), from frame to
    frame or from run to run. The median over the frames lets a few odd ones pass, and white noise within its own
    scatter leaves the reading's noise as it is.
    """
    reading_v, reading_error = reading
    count, width = scans.shape
    space = np.linalg.qr(columns)[0]
    freedom = width - space.shape[1]
    if count < ENOUGH_RESTS or freedom <= 0:
        return Noise(reading_v, reading_error, np.zeros((width, 0)))
    jump = _jumps(scans)
    squares = ((jump - jump @ space @ space.T) ** 2).sum(axis=1) / freedom
    outside = float(np.median(squares))
    coloured = outside > ((1 + COLOURED) * reading_v) ** 2
    noise_v = max(reading_v, float(np.sqrt(outside))) if coloured else reading_v
    # Of a median, half of it for the root; the squares of overlapping second differences count half.
    own_error = 0.5 * 1.25 * float(squares.std()) / outside / np.sqrt(len(jump) / 2) if coloured else 0.0
    error = max(own_error, reading_error)
    surely = np.sqrt(outside) / reading_v > 1 + SURELY_COLOURED * own_error
    inside = scans @ space / noise_v
    excess_noise = space @ max(
        _excess_noise(_jumps(inside)), _excess_noise(_jumps_of_runs(inside, run)), key=np.linalg.norm
    )
    jittering = -1 if coloured and surely else _jittering(excess_noise, columns[:, :-1], criteria)
    return Noise(noise_v, error, excess_noise, jittering)


def _jumps(scans: Array) -> Array:
    """(R-2,P) second differences of scans (R,P), as large as the scans' noise."""
    return np.diff(scans, n=2, axis=0) / np.sqrt(6)


def _jumps_of_runs(scans: Array, run: NDArray[np.intp]) -> Array:
    """(J,P) the same of frames from runs on end: one of each, then another of each, as often as most runs allow."""
    _, first, count = np.unique(run, return_index=True, return_counts=True)
    turns = int(np.median(count)) if len(first) >= ENOUGH_RESTS else 0
    found = [_jumps(scans[first + turn % count]) for turn in range(turns)]
    return np.concatenate([np.empty((0, scans.shape[1])), *found])


def _excess_noise(jump: Array) -> Array:
    """(n,k) the directions in which jumps (J,n) are larger than white noise of one would be, as long as the excess."""
    if not len(jump):
        return np.zeros((jump.shape[1], 0))
    size, axes = np.linalg.eigh(jump.T @ jump / len(jump))
    more = size > _largest_by_chance(len(jump) + 2, len(size))
    return np.asarray(axes[:, more] * np.sqrt(size[more] - 1))


def _jittering(excess_noise: Array, contacts: Array, criteria: Criteria) -> int:
    """The contact, by its column among (P,L), along which the largest ``excess_noise`` lies, if that is material.

    Contacts that all jitter alike are how the skin is made, not one that is loose.
    """
    if not excess_noise.shape[1] or (excess_noise**2).sum() < (criteria.material_ratio**2 - 1) * len(excess_noise):
        return -1
    largest = excess_noise[:, -1] / np.linalg.norm(excess_noise[:, -1])
    along = np.abs(largest @ contacts) / np.linalg.norm(contacts, axis=0)
    inverse = np.linalg.pinv(contacts)
    share = np.sqrt(((inverse @ excess_noise) ** 2).sum(axis=1))
    loose = int(along.argmax())
    return loose if along[loose] > ALONG and share[loose] > STANDS_OUT * np.median(share) else -1


@cache
def _largest_by_chance(count: int, width: int) -> float:
    """What the largest eigenvalue in ``_scatter`` exceeds once in ``1 / RARELY`` where ``count`` frames are white."""
    rng = np.random.default_rng(0)
    jump = np.diff(rng.standard_normal((CHANCES, count, width)), n=2, axis=1) / np.sqrt(6)
    size = np.linalg.eigvalsh(np.einsum("crn,crm->cnm", jump, jump, optimize=True) / jump.shape[1])
    return float(np.quantile(size[:, -1], 1 - RARELY))

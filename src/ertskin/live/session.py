"""From scans to what is shown: zeroing, the network, contacts, drift, and how fast it all is."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.instrument import Scan
from ertskin.live.predictor import Predictor
from ertskin.live.watch import SeenScan, Watch
from ertskin.models.estimate import Estimate
from ertskin.physics.touch.search import Held

Array = NDArray[np.float64]
DRIFT_NOISES = 3.0
"""An untouched skin whose readings are off by this many times their noise has drifted."""
LEAST_FORCE_N = 0.05
TOUCH_SHARE, TOUCH_SIGMAS = 0.05, 6.0
"""A change whose mean square is less than this share, and this many of its own standard deviations, above what noise
gives is no touch. No trial a network learns from is untouched: asked about noise, it finds something in it."""
SPIKE_SIGMAS = 4.0
"""Beyond so many times the noise a reading counts as no more than that: a spike is no touch either."""


LEFT = (
    "the skin has left what the network was trained for: frames beyond the limit that one in 1000 exceeds by chance; "
    "zero again, and if that does not help, calibrate and train again"
)


@dataclass(frozen=True)
class Contact:
    """Where and how hard: metres on the sheet, newton."""

    x_m: float
    y_m: float
    force_n: float


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One scan's outcome. ``latency_s``: from the scan in memory to the force map; ``rate_hz``: scans a second.

    Of a network that knows its skin: ``novelty``, how unlike frames it was trained on this one is, 1 being what one in
    a thousand exceeds by chance; ``sheet_change``, relative, since the calibration; ``left``, whether the skin has left
    what was trained for.
    """

    number: int
    time_s: float
    force_map_n: Array
    contacts: tuple[Contact, ...]
    latency_s: float
    rate_hz: float
    drift: float
    lost: int
    saturated: float
    zeroing: bool
    novelty: float | None = None
    sheet_change: float | None = None
    left: bool = False

    @property
    def warnings(self) -> list[str]:
        """What somebody looking on should know."""
        found = []
        if self.zeroing:
            found.append("zeroing: do not touch")
        if self.drift > DRIFT_NOISES:
            found.append(f"readings have drifted by {self.drift:.1f} times their noise: zero again")
        if self.left:
            found.append(LEFT)
        if self.saturated > 0:
            found.append(f"{100 * self.saturated:.2g} % of readings saturated")
        if self.lost:
            found.append(f"{self.lost} scans lost")
        return found


class Session:
    """Follows one skin. Begins with zeroing."""

    def __init__(
        self, predictor: Predictor, zero_scans: int = 4, noise_v: float = 0.0, watch: Watch | None = None
    ) -> None:
        """``zero_scans``: untouched scans a baseline is the mean of. ``noise_v``: noise of a reading, which several of
        them tell by themselves; where it is not known every scan counts as touched. ``watch`` follows the resting skin
        and tells strange frames; without it changes count from the zero alone."""
        self._predictor = predictor
        self._watch = watch
        self._zero_scans = zero_scans
        self._gathered: list[Array] = []
        self._gathered_s: list[float] = []
        self._zero_asked = False
        self._rest_v: NDArray[np.float32] | None = None
        self._noise_v = noise_v
        self._number = 0
        self._lost = 0
        self._times: deque[float] = deque(maxlen=20)
        self._drift: deque[float] = deque(maxlen=5)
        self._held: Held | None = None
        self._unneeded_v: Array | None = None
        taxels = len(predictor.kind.taxel_m)
        self._nothing = Estimate(np.zeros((1, taxels)), np.zeros((1, taxels), dtype=bool))

    def zero(self) -> None:
        """Take the coming scans as untouched; may be asked for from another thread."""
        self._zero_asked = True

    def rehearse(self) -> None:
        """To be called while the next scan is awaited: keeps a network at hand that the latest may not have needed."""
        if self._unneeded_v is not None:
            self._predictor.rehearse(self._unneeded_v)
            self._unneeded_v = None

    def see(self, scan: Scan) -> LiveFrame:
        """What a scan means."""
        self._number += 1
        self._lost += scan.lost
        self._times.append(scan.time_s)
        if self._zero_asked:
            self._zero_asked = False
            self._gathered, self._gathered_s, self._rest_v, self._held = [], [], None, None
            self._drift.clear()
        if self._rest_v is None:
            self._gather(scan)
            return self._frame(scan, None, 0.0)
        return self._seen_by_zero(scan) if self._watch is None else self._seen_by(self._watch, scan)

    def _seen_by(self, watch: Watch, scan: Scan) -> LiveFrame:
        """On the resting skin as it is followed."""
        begin = time.perf_counter()
        seen = watch.see(scan.voltage_v, scan.time_s)
        estimate, held = (self._nothing, None) if seen.at_rest else self._answered(seen)
        novelty, at_rest = watch.judged(seen, estimate)
        estimate, self._held = (self._nothing, None) if at_rest else (estimate, held)
        latency = time.perf_counter() - begin
        self._unneeded_v = seen.coordinates_v if at_rest or held is not None else None
        if not estimate.present.any():
            self._drift.append(float(np.sqrt(max(0.0, seen.surprise * watch.monitor.resting.limit - 1.0))))
        frame = self._frame(scan, estimate, latency)
        return replace(frame, novelty=novelty, sheet_change=watch.state.gain - 1.0, left=watch.left)

    def _answered(self, seen: SeenScan) -> tuple[Estimate, Held | None]:
        if self._predictor.reads_coordinates:
            return self._predictor.followed(seen.coordinates_v, self._held)
        return self._predictor.estimate(seen.change_v[None]), None

    def _seen_by_zero(self, scan: Scan) -> LiveFrame:
        """Against the zero alone."""
        assert self._rest_v is not None
        begin = time.perf_counter()
        change = scan.voltage_v - self._rest_v
        estimate = (
            self._predictor.estimate(change[None])
            if touched(change[None], self._noise_v, self._zero_scans)[0]
            else self._nothing
        )
        latency = time.perf_counter() - begin
        if not estimate.present.any():
            self._drift.append(self._off(change))
        return self._frame(scan, estimate, latency)

    def _gather(self, scan: Scan) -> None:
        self._gathered.append(scan.voltage_v.astype(float))
        self._gathered_s.append(scan.time_s)
        if len(self._gathered) == self._zero_scans:
            stack = np.stack(self._gathered)
            self._rest_v = stack.mean(axis=0).astype(np.float32)
            if self._watch is not None:
                self._watch.begin(stack, np.array(self._gathered_s))
            if len(stack) > 1:
                self._noise_v = noise_of(stack)

    def _off(self, change_v: NDArray[np.float32]) -> float:
        """Systematic part of a change in units of the noise, robust against spikes: 0 for noise alone."""
        if self._noise_v == 0.0:
            return 0.0
        expected = self._noise_v * np.sqrt(1.0 + 1.0 / self._zero_scans)
        size = 1.4826 * float(np.median(np.abs(change_v))) / expected
        return float(np.sqrt(max(0.0, size**2 - 1.0)))

    def _frame(self, scan: Scan, estimate: Estimate | None, latency_s: float) -> LiveFrame:
        taxels = self._predictor.kind.taxel_m
        force = np.zeros(len(taxels)) if estimate is None else estimate.force_map_n[0]
        contacts = () if estimate is None else contacts_of(estimate, taxels)
        span = self._times[-1] - self._times[0]
        rate = (len(self._times) - 1) / span if span > 0 else 0.0
        drift = float(np.median(self._drift)) if self._drift else 0.0
        saturated = 0.0 if scan.saturated is None else float(scan.saturated.mean())
        return LiveFrame(
            self._number, scan.time_s, force, contacts, latency_s, rate, drift, self._lost, saturated, estimate is None
        )


def touched(change_v: NDArray[np.floating], noise_v: float, zero_scans: int) -> NDArray[np.bool_]:
    """(N,) whether changes (N,K,M) against the mean of ``zero_scans`` scans are more than noise and spikes.

    All of them where the noise of a reading is not known (0).
    """
    if noise_v == 0.0:
        return np.ones(len(change_v), dtype=bool)
    expected = noise_v**2 * (1.0 + 1.0 / zero_scans)
    square = np.minimum(np.square(change_v), SPIKE_SIGMAS**2 * expected)
    ratio = 1.0 + TOUCH_SHARE + TOUCH_SIGMAS * np.sqrt(2.0 / square[0].size)
    return np.asarray(square.mean(axis=(1, 2)) > ratio * expected)


def noise_of(scans_v: Array) -> float:
    """Noise of a reading in volt, from the differences of untouched scans (n,K,M), spikes left out."""
    step = np.abs(np.diff(scans_v, axis=0)) / np.sqrt(2.0)
    # Noise far below a count of the converter makes most differences 0: then none is left out.
    most = SPIKE_SIGMAS * 1.4826 * float(np.median(step)) or np.inf
    return float(np.sqrt(np.mean(np.square(step[step <= most]))))


def contacts_of(estimate: Estimate, taxel_m: Array) -> tuple[Contact, ...]:
    """The contacts of the first frame, strongest first; on the taxels where the network doesn't place them itself."""
    if estimate.contact_m is not None and estimate.contact_force_n is not None:
        places, forces = estimate.contact_m[0], estimate.contact_force_n[0]
    else:
        places, forces = taxel_m[estimate.present[0]], estimate.force_map_n[0][estimate.present[0]]
    found = [
        Contact(float(x), float(y), float(force))
        for (x, y), force in zip(places, forces, strict=True)
        if np.isfinite(force) and force > LEAST_FORCE_N
    ]
    return tuple(sorted(found, key=lambda contact: -contact.force_n))

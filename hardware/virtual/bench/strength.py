"""How strong is strong: the strength of an effect at which it stands out of the noise by a given ratio.

The ratio is the design's: residual rms over noise rms of a baseline that was calibrated to the same recording. Here the
calibration is linear: what contact resistances, sheet resistance, the law's shape and the fabric's modulus could have
absorbed is projected out of the effect's noise-free signal. Forces are compared likewise, less what a stiffness and a
support could have absorbed. Voltages are compared at equal force, as the load cell tells it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.virtual.bench.bench import Bench
from ertskin.hardware.virtual.bench.effects import EFFECTS
from ertskin.hardware.virtual.bench.nominal import nominal_protocol, nominal_sensor
from ertskin.hardware.virtual.bench.plans import QUICK_TAXELS, presses
from ertskin.hardware.virtual.bench.skin import FAST
from ertskin.hardware.virtual.bench.truth import Truth, draw_truth
from ertskin.physics.history import History

Array = NDArray[np.float64]

_DEPTH_M = np.array([1.5e-3, 4e-3])
_STRONGEST = 30.0


@dataclass(frozen=True)
class Ratios:
    """Residual rms over noise rms, with the noise.

    ``voltage`` in the readings, ``reciprocal`` in the numbers a resistor network is described by (noise stays white in
    them, and they are far fewer), ``force`` in the load cell's readings.
    """

    voltage: float
    reciprocal: float
    force: float

    @property
    def own(self) -> float:
        """The larger of voltage and force: where the effect shows."""
        return max(self.voltage, self.force)


class Ruler:
    """Measures effects on the skin of one seed by a short plan of its own: a few taxels, two depths, up and down."""

    def __init__(
        self,
        seed: int,
        white_v: float = 2e-3,
        force_noise_n: float = 0.01,
        taxels: Sequence[int] = QUICK_TAXELS,
    ) -> None:
        self.seed, self.white_v, self.force_noise_n = seed, white_v, force_noise_n
        self.sensor = nominal_sensor()
        self.protocol = nominal_protocol(self.sensor)
        self.history = presses(self.sensor.taxel_m[list(taxels)], _DEPTH_M, holds=1)

    def measure(self, effects: Mapping[str, float]) -> Ratios:
        """How far effects of these strengths, all together, stand out."""
        bare = draw_truth(self.sensor, self.seed)
        voltage, history = self._run(draw_truth(self.sensor, self.seed, dict(effects)), self.history)
        moved = np.nanmax(np.abs(history.force_n - self._forces)) > 1e-9
        bare_v = self._run(bare, self._imposed(history))[0] if moved else self._bare_v
        left = self._unexplained((voltage - bare_v).ravel()).reshape(len(voltage), -1)
        network = left @ self.protocol.orthonormal
        return Ratios(
            float(np.sqrt(1.0 + np.mean(left**2) / self.white_v**2)),
            float(np.sqrt(1.0 + np.mean(network**2) / self.white_v**2)),
            self._force_ratio(history.force_n[:, 0]),
        )

    def strength(self, name: str, ratio: float, rounds: int = 6) -> tuple[float, Ratios]:
        """The strength at which one effect has its ``own`` ratio, and the ratios reached.

        The nearest of those tried, for what happens by chance, as a channel that freezes, jumps with its strength; an
        effect that can't be made strong enough is left at the strongest.
        """
        if name not in EFFECTS:
            raise KeyError(f"the bench has no effect named {name!r}")
        strength, tried = 1.0, []
        for _ in range(rounds + 1):
            reached = self.measure({name: strength})
            tried.append((strength, reached))
            if abs(reached.own - ratio) < 0.02 * (ratio - 1.0) + 0.003:
                break
            step = np.sqrt((ratio**2 - 1.0) / max(reached.own**2 - 1.0, 1e-6))
            if strength >= _STRONGEST and step > 1.0:
                break
            strength = float(min(strength * np.clip(step, 0.02, 8.0), _STRONGEST))
        return min(tried, key=lambda found: abs(found[1].own - ratio))

    def _run(self, truth: Truth, history: History) -> tuple[Array, History]:
        frames = Bench(truth, self.sensor, self.protocol, FAST).frames(history, "ruler", ideal=True)
        return self.protocol.filled(frames.voltage_v.astype(float)), frames.history

    def _imposed(self, history: History) -> History:
        """The same presses by force instead of depth."""
        return replace(self.history, depth_m=np.full_like(history.depth_m, np.nan), force_n=history.force_n)

    @cached_property
    def _bare(self) -> tuple[Array, History]:
        return self._run(draw_truth(self.sensor, self.seed), self.history)

    @property
    def _bare_v(self) -> Array:
        return self._bare[0]

    @property
    def _forces(self) -> Array:
        return self._bare[1].force_n

    @cached_property
    def _absorbing(self) -> Array:
        """(T*K*M, n) orthonormal basis of what a calibration could change."""
        bare, imposed = draw_truth(self.sensor, self.seed), self._imposed(self._bare[1])
        frames = len(self.history)
        current, weight = self.protocol.injection_current_a, self.protocol.measurement
        series = (weight * current[:, None, :]).reshape(-1, current.shape[1])
        columns = [np.tile(series, (frames, 1)), self._bare_v.reshape(-1, 1)]
        for name, share in (("floor_ohm", 0.01), ("exponent", 0.01), ("closing_pa", 0.01), ("zero_ohm", 0.01)):
            shifted = replace(bare, law={**bare.law, name: bare.law[name] * (1 + share)})
            columns.append((self._run(shifted, imposed)[0] - self._bare_v).reshape(-1, 1) / share)
        fabric = {name: value * (1.05 if "fabric" in name else 1.0) for name, value in bare.modulus_pa.items()}
        softer = self._run(replace(bare, modulus_pa=fabric), imposed)[0] - self._bare_v
        columns.append(softer.reshape(-1, 1) / 0.05)
        block = np.concatenate(columns, axis=1)
        return np.linalg.qr(block / np.linalg.norm(block, axis=0))[0]

    def _unexplained(self, signal: Array) -> Array:
        basis = self._absorbing
        return signal - basis @ (basis.T @ signal)

    def _force_ratio(self, force_n: Array) -> float:
        pressed = np.isfinite(force_n) & self.history.touched[:, 0]
        force, depth = force_n[pressed], self.history.depth_m[pressed, 0]
        slope = float(force @ depth / (depth @ depth))
        left = force - slope * depth
        return float(np.sqrt(1.0 + np.mean(left**2) / self.force_noise_n**2))

"""What is true of one simulated skin and its rig, and hidden from whoever reads its recordings."""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ertskin.hardware.virtual.bench.effects import EFFECTS, Parameters
from ertskin.physics.sensor import Sensor


@dataclass(frozen=True)
class Noise:
    """How the readings err: all amplitudes in the unit of the name.

    ``coloured_share`` of the white variance is correlated along the scan; ``spike_share`` of the readings are off by
    about ``spike_v``; a press is off by ``press_gain`` (relative), every contact resistance walks by ``walk_share`` of
    itself from press to press and is drawn back, and jitters by ``jitter_share`` of itself from scan to scan; weights
    are put down within ``placement_m``, and a stage lands within ``landing_m`` of where it is sent.
    """

    white_v: float = 2e-3
    coloured_share: float = 0.0
    spike_share: float = 0.0
    spike_v: float = 0.05
    walk_share: float = 0.0
    jitter_share: float = 0.0
    press_gain: float = 0.0
    placement_m: float = 0.0
    landing_m: float = 0.0
    force_n: float = 0.01
    specimen_share: float = 0.0025


BAD_RIG = Noise(spike_share=0.003, spike_v=0.1, walk_share=0.08, press_gain=0.02, placement_m=1e-3)
"""A bench with spikes, contacts that drift, presses that don't repeat and weights put down by hand."""


@dataclass(frozen=True)
class Truth:
    """Moduli, contact resistances, law, hidden effects (name to strength and parameters) and noise of one skin."""

    seed: int
    contact_ohm: tuple[float, ...]
    modulus_pa: dict[str, float]
    support_n_per_m: float
    law: dict[str, float]
    effects: dict[str, dict[str, Any]] = field(default_factory=dict)
    noise: Noise = field(default_factory=Noise)

    def parameters(self, name: str) -> Parameters | None:
        """The physical parameters of a hidden effect, ``None`` where the skin doesn't have it."""
        hidden = self.effects.get(name)
        return None if hidden is None else hidden["parameters"]

    def rng(self, purpose: str) -> np.random.Generator:
        """A generator of its own for every purpose, the same for the same seed."""
        return np.random.default_rng(np.random.SeedSequence([self.seed, zlib.crc32(purpose.encode())]))

    def to_json(self) -> str:
        """Readable text, keys sorted: the same truth gives the same bytes."""
        return json.dumps(asdict(self), indent=1, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Truth:
        """The inverse of ``to_json``."""
        held = json.loads(text)
        return cls(**{**held, "contact_ohm": tuple(held["contact_ohm"]), "noise": Noise(**held["noise"])})


def draw_truth(sensor: Sensor, seed: int, effects: dict[str, float] | None = None, noise: Noise | None = None) -> Truth:
    """A skin of its own for every seed; ``effects`` maps names to strengths.

    Raises ``KeyError`` naming the effect if it isn't one of ``EFFECTS``. Contact resistances, moduli and law do not
    depend on the effects: the same seed with and without one is the same skin with and without it.
    """
    unknown = set(effects or {}) - set(EFFECTS)
    if unknown:
        raise KeyError(f"the bench has no effect named {sorted(unknown)}; it has {sorted(EFFECTS)}")
    bare = Truth(seed, (), {}, 0.0, {})
    rng = bare.rng("skin")
    contact = np.exp(rng.uniform(np.log(200.0), np.log(1000.0), sensor.electrodes))
    stiffer, softer = rng.uniform(1.9, 2.4), rng.uniform(0.85, 1.2)
    modulus = {layer.name: layer.youngs_modulus_pa for layer in sensor.layers}
    fabric = [name for name in modulus if "fabric" in name]
    modulus |= {name: modulus[name] * stiffer * softer for name in fabric}
    modulus |= {name: modulus[name] * stiffer for name in modulus if "foam" in name or "neoprene" in name}
    law = {
        "zero_ohm": sensor.sheet_resistance_ohm_sq,
        "floor_ohm": sensor.sheet_resistance_ohm_sq * rng.uniform(0.20, 0.25),
        "closing_pa": 6e4,
        "exponent": rng.uniform(4.1, 4.8),
    }
    hidden = {
        name: {"strength": strength, "parameters": EFFECTS[name].draw(strength, bare.rng(name), sensor)}
        for name, strength in (effects or {}).items()
    }
    support = 9e3 * rng.uniform(0.9, 1.1)
    return Truth(seed, tuple(contact.tolist()), modulus, support, law, hidden, noise or Noise())

"""An independent simulator of skin and rig, with effects hidden in it.

It shares no formula, element or constitutive form with ``physics``: the sheet is spectral elements merged rectangle by
rectangle, the pad a Fourier series with spectral elements through its thickness, the pair a closing law. What it
writes is a recording like any other. ``write_bench`` writes one file, ``Bench`` runs any history, ``LiveSkin`` answers
in real time.
"""

from ertskin.hardware.virtual.bench.bench import Bench
from ertskin.hardware.virtual.bench.effects import EFFECTS
from ertskin.hardware.virtual.bench.live import LiveSkin
from ertskin.hardware.virtual.bench.skin import FAST, FINE, FINEST
from ertskin.hardware.virtual.bench.truth import BAD_RIG, Noise, Truth, draw_truth
from ertskin.hardware.virtual.bench.writing import write_bench

__all__ = [
    "BAD_RIG",
    "EFFECTS",
    "FAST",
    "FINE",
    "FINEST",
    "Bench",
    "LiveSkin",
    "Noise",
    "Truth",
    "draw_truth",
    "write_bench",
]

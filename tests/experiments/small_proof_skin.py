"""A small skin of the proof's generator: eight pads on 60 mm, pressed twice in the middle and once near a pad."""

from __future__ import annotations

import numpy as np
from generator.layered import Layer
from generator.mesh import Fineness
from generator.protocol import Plan, Press, all_pairs
from generator.sheet import Electrodes
from generator.skin import Noise, Skin, law_of

SIDE_M = 0.06
LAYERS = (
    Layer("neoprene", 0.004, 28e3, 0.3),
    Layer("glue", 0.0002, 1e6, 0.495),
    Layer("patch_fabric", 0.0004, 344e3, 0.4),
    Layer("sheet_fabric", 0.0008, 344e3, 0.4),
)
COARSE = Fineness(4.5e-3, 1.6e-3, 2e-4)


def small_skin() -> Skin:
    """The skin; the third electrode lies under one of the presses."""
    low, middle, high = 0.006, 0.03, 0.054
    center = np.array([[low, low], [middle, low], [high, low], [high, middle], [high, high], [middle, high],
                       [low, high], [low, middle]])  # fmt: skip
    outline = SIDE_M * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = np.array([[0.03, 0.03], [0.052, 0.01], [0.03, 0.03]])
    presses = tuple(Press(p[None], np.array([1.5e-3, 3e-3]), 0.5, 1, 4.0, 10.0) for p in places)
    points = 2.5e-3 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    taxels = np.array([[x, y] for y in (0.014, 0.03, 0.046) for x in (0.014, 0.03, 0.046)])
    return Skin(
        4, outline, Electrodes(center, np.full((8, 2), 0.004)), LAYERS, 2, 0.01, points, 0.03, 5e3,
        np.array([150.0, 220.0, 90.0, 180.0, 130.0, 260.0, 110.0, 170.0]), 1e4,
        law_of(np.random.default_rng(0), 3e4), taxels, all_pairs(8, 3.6e-4, 0.2), Plan(presses), Noise(), {}, COARSE,
    )  # fmt: skip

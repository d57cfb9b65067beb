"""The skins of the suite: outlines, electrodes, pads, protocols and plans, drawn from a seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .layered import Layer
from .mesh import inside
from .protocol import Protocol, adjacent, all_pairs, plan_of, spread
from .sheet import Electrodes
from .skin import Noise, Skin, law_of

Array = NDArray[np.float64]
SHAPES = ("square24", "square16", "oblong32", "round16", "round32", "cut_corner24")
PADS = ("neoprene", "silicone", "soft_foam", "stiff_rubber")


def drawn(seed: int, shape: str, pad: str, scan: str, presses: int, noise: Noise, levels: int | None = None) -> Skin:
    """One skin. ``scan`` is ``full``, ``adjacent`` (driven electrodes not read) or ``sparse``."""
    rng = np.random.default_rng([seed, 1])
    outline, electrodes, taxels = _sheet(shape)
    layers, said = _pad(pad, rng)
    sheet_ohm = float(np.exp(rng.uniform(np.log(2e3), np.log(2.5e4))))
    current = round(1.8 / sheet_ohm, 7)
    diameter = float(rng.choice([0.008, 0.010, 0.012]))
    points = 0.25 * diameter * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    stiffness = layers[0].youngs_modulus_pa / 28e3
    deepest = {"neoprene": 3.2e-3, "silicone": 2.0e-3, "soft_foam": 4.0e-3, "stiff_rubber": 1.2e-3}[pad]
    count = levels or (8 if presses <= 12 else 6 if presses <= 20 else 4)
    margin = 3.0 * sum(layer.thickness_m for layer in layers) + 0.015
    top = float(np.round(15e3 * stiffness * deepest / 3.2e-3 * rng.uniform(1.6, 2.4), -2))
    return Skin(
        seed, outline, electrodes, layers, 2, diameter, points, round(margin, 3), sheet_ohm,
        np.asarray(sheet_ohm * np.exp(rng.normal(np.log(0.03), 0.35, len(electrodes)))),
        float(rng.uniform(7e3, 1.4e4) * max(1.0, stiffness)), law_of(rng, top), taxels,
        _protocol(scan, len(electrodes), current, rng), plan_of(rng, taxels, presses, deepest, count), noise, said,
    )  # fmt: skip


def misdescribed(skin: Skin) -> Skin:
    """The maker's sheet of data is off: foam, fabrics, sheet resistance, contacts."""
    wrong = {
        x.name: x.youngs_modulus_pa * (1.7 if i == 0 else 0.75) for i, x in enumerate(skin.layers) if x.name != "glue"
    }
    return replace(
        skin, said={**skin.said, **wrong, "sheet_ohm": 0.8 * skin.sheet_ohm, "contact_ohm": 0.06 * skin.sheet_ohm}
    )


def _pad(pad: str, rng: np.random.Generator) -> tuple[tuple[Layer, ...], dict[str, float]]:
    """Layers as they are, and the moduli their maker says."""
    top = {
        "neoprene": Layer("neoprene", 0.004, 28e3, 0.3), "silicone": Layer("silicone", 0.004, 1e5, 0.45),
        "soft_foam": Layer("pu_foam", 0.006, 14e3, 0.2), "stiff_rubber": Layer("rubber", 0.003, 2.5e5, 0.47),
    }[pad]  # fmt: skip
    names = ("patch_fabric", "sheet_fabric", "base_fabric")
    nominal = (top, Layer("glue", 0.0002, 1e6, 0.495), *(Layer(n, 0.0004, 344e3, 0.4) for n in names))
    foam, cloth = np.exp(rng.normal(0.0, 0.12, 2))
    true = tuple(
        x
        if x.name == "glue"
        else replace(x, youngs_modulus_pa=float(x.youngs_modulus_pa * (foam if x is top else cloth)))
        for x in nominal
    )
    return true, {x.name: x.youngs_modulus_pa for x in nominal}


def _protocol(scan: str, electrodes: int, current: float, rng: np.random.Generator) -> Protocol:
    scan_s = 0.4 if electrodes >= 24 else 0.2
    if scan == "adjacent":
        return adjacent(electrodes, 2.5 * current, scan_s)
    if scan == "sparse":
        return spread(electrodes, 2 * electrodes, current, scan_s, rng)
    return all_pairs(electrodes, current, scan_s, 2 if electrodes > 24 else 1)


def _ring(size: tuple[float, float], along: tuple[int, int], inset: float) -> Array:
    """Pads in order round a rectangle, ``along`` on its sides."""
    (lx, ly), (nx, ny) = size, along
    x, y = np.linspace(inset, lx - inset, nx), np.linspace(inset, ly - inset, ny)
    low, high = np.full(nx - 1, inset), np.full(nx - 1, ly - inset)
    return np.concatenate([
        np.stack([x[:-1], low], 1), np.stack([np.full(ny - 1, lx - inset), y[:-1]], 1),
        np.stack([x[:0:-1], high], 1), np.stack([np.full(ny - 1, inset), y[:0:-1]], 1),
    ])  # fmt: skip


def _pads(center: Array, edge: float) -> Electrodes:
    return Electrodes(center, np.full((len(center), 2), edge))


def _round(count: int, radius: float, cover: float) -> tuple[Array, Electrodes]:
    """A polygon of chords and every second one an electrode."""
    start = 2 * np.pi * np.arange(count) / count
    angle = np.stack([start, start + cover * 2 * np.pi / count], axis=1).ravel()
    fine = np.concatenate([np.linspace(a, b, 4)[:-1] for a, b in zip(angle, [*angle[1:], 2 * np.pi], strict=True)])
    at = radius + radius * np.stack([np.cos(fine), np.sin(fine)], axis=1)
    # An electrode is a straight stretch: its chord replaces the arc's points between its ends.
    kept = np.ones(len(fine), dtype=bool)
    kept[np.concatenate([[6 * n + 1, 6 * n + 2] for n in range(count)])] = False
    edge = radius + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(count, 2, 2)
    return at[kept], Electrodes(edge_m=edge)


def _sheet(shape: str) -> tuple[Array, Electrodes, Array]:
    """Outline, electrodes and sensing points of one of ``SHAPES``."""
    if shape.startswith("round"):
        radius = 0.06
        outline, electrodes = _round(int(shape[5:]), radius, 0.4)
        return outline, electrodes, _grid(outline, 0.02)
    size = {"square24": (0.12, 0.12), "square16": (0.1, 0.1), "oblong32": (0.18, 0.1), "cut_corner24": (0.13, 0.11)}[
        shape
    ]
    outline = np.array([[0, 0], [size[0], 0], [size[0], size[1]], [0, size[1]]], dtype=float)
    if shape == "square24":
        inner = np.array([[0.04, 0.04], [0.08, 0.04], [0.04, 0.08], [0.08, 0.08]])
        electrodes = _pads(np.concatenate([_ring(size, (6, 6), 0.006), inner]), 0.004)
    elif shape == "square16":
        electrodes = _pads(np.concatenate([_ring(size, (4, 4), 0.006), _ring(size, (2, 2), 0.034)]), 0.005)
    elif shape == "oblong32":
        electrodes = _pads(np.concatenate([_ring(size, (9, 5), 0.006), _ring(size, (3, 3), 0.036)]), 0.004)
    else:
        outline = np.array([[0, 0], [0.13, 0], [0.13, 0.06], [0.09, 0.11], [0, 0.11]], dtype=float)
        rim = [[0.006, 0.006], [0.029, 0.006], [0.052, 0.006], [0.075, 0.006], [0.1, 0.006], [0.124, 0.006],
               [0.124, 0.03], [0.122, 0.055], [0.109, 0.075], [0.093, 0.096], [0.075, 0.104], [0.052, 0.104],
               [0.029, 0.104], [0.006, 0.104], [0.006, 0.08], [0.006, 0.055], [0.006, 0.03]]  # fmt: skip
        middle = [[0.035, 0.035], [0.065, 0.035], [0.095, 0.035], [0.035, 0.075], [0.065, 0.075], [0.05, 0.055],
                  [0.085, 0.06]]  # fmt: skip
        electrodes = _pads(np.array(rim + middle), 0.004)
    return outline, electrodes, _grid(outline, 0.02)


def _grid(outline: Array, pitch: float) -> Array:
    """Sensing points on a grid, at least 7 mm from the outline."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    count = np.round((high - low) / pitch).astype(int)
    axes = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, count, strict=True)]
    grid = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="xy")], axis=1)
    a, b = outline, np.roll(outline, -1, axis=0)
    t = np.clip(((grid[:, None] - a) * (b - a)).sum(2) / ((b - a) ** 2).sum(1), 0, 1)
    distance = np.hypot(*(grid[:, None] - (a + t[..., None] * (b - a))).transpose(2, 0, 1)).min(axis=1)
    return np.asarray(grid[inside(outline, grid) & (distance > 0.007)])

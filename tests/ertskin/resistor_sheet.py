"""A coarse sheet of resistors to learn from in tests: small, nonlinear, and no part of the simulator."""

import numpy as np

from ertskin.data.material import Material
from ertskin.data.trials import TrialSet, joined
from ertskin.physics.noise import WhiteNoise
from ertskin.physics.protocol import Protocol, electrode_pairs, pair_resistances

SIDE, SIZE_M = 9, 0.09


def protocol(electrodes: int = 8) -> Protocol:
    return Protocol.against_sink(electrode_pairs(electrodes), electrodes, 1e-3)


def taxel_m(grid: int = 3) -> np.ndarray:
    centre = (np.arange(grid) + 0.5) * SIZE_M / grid
    return np.stack(np.meshgrid(centre, centre, indexing="xy"), axis=-1).reshape(-1, 2)


def trials(count: int, contacts: int, seed: int, grid: int = 3, jitter_m: float = 0.0) -> TrialSet:
    """``count`` presses of 0.5 to 10 N on ``contacts`` different taxels."""
    rng = np.random.default_rng((seed, contacts))
    taxels = taxel_m(grid)
    taxel = np.array([rng.choice(len(taxels), contacts, replace=False) for _ in range(count)])
    force = rng.uniform(0.5, 10.0, (count, contacts))
    place = taxels[taxel] + jitter_m * rng.uniform(-1, 1, (count, contacts, 2))
    label = np.zeros((count, len(taxels)))
    np.put_along_axis(label, taxel, force, axis=1)
    return TrialSet(change_ohm(place, force), label, place, force)


def mixed(count: int, seed: int, grid: int = 3, jitter_m: float = 0.0) -> TrialSet:
    return joined([trials(count // 3, 1, seed, grid, jitter_m), trials(count - count // 3, 2, seed, grid, jitter_m)])


def change_ohm(place: np.ndarray, force: np.ndarray) -> np.ndarray:
    """(N,P) pair resistances of sheets pressed at ``place`` (N,C,2) with ``force`` (N,C), less those at rest."""
    return _pairs(place, force) - _pairs(place[:1], np.zeros_like(force[:1]))


def _pairs(place: np.ndarray, force: np.ndarray) -> np.ndarray:
    node = (np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij"), -1).reshape(-1, 2) + 0.5) / SIDE
    node_m = node * SIZE_M
    index = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    edges = np.concatenate(
        [
            np.stack([index[:-1].ravel(), index[1:].ravel()], 1),
            np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()], 1),
        ]
    )
    middle = node_m[edges].mean(axis=1)
    away2 = ((middle - place[:, :, None, :]) ** 2).sum(axis=-1)
    pressure = (force[:, :, None] * np.exp(-away2 / (2 * 0.012**2))).sum(axis=1)
    conductance = 1e-3 * (1 + 2 * np.tanh(pressure / 2))
    laplacian = np.zeros((len(place), SIDE * SIDE, SIDE * SIDE))
    first, second = edges.T
    np.add.at(laplacian, (slice(None), first, first), conductance)
    np.add.at(laplacian, (slice(None), second, second), conductance)
    laplacian[:, first, second] = laplacian[:, second, first] = -conductance
    rim = np.concatenate([index[0, ::4], index[-1, ::4], index[4, [0, -1]]])
    inverse = np.linalg.inv(laplacian + 1e-3 / (SIDE * SIDE))
    return pair_resistances(inverse[:, rim[:, None], rim[None, :]])


def material(config: object, count: int) -> Material:
    """What the command "train" is given with ``data=resistor_sheet``."""
    skin, learned = protocol(), mixed(count, seed=0)
    noise = WhiteNoise(skin, 0.003 * float(learned.readings_v(skin).std()))
    return Material(skin, taxel_m(), learned, noise, f"resistor-sheet-{count}", mixed(count // 3, seed=1))

"""A response that is known in closed form: receptive fields over a sheet, saturating with force."""

from __future__ import annotations

import numpy as np

from ertskin.physics.touch.interplay import Interplay
from ertskin.physics.touch.table import ResponseTable, TouchGrid

EXTENT_M = np.array([[0.0, 0.0], [0.08, 0.06]])
FIELDS_M = np.stack(np.meshgrid(np.linspace(0, 0.08, 7), np.linspace(0, 0.06, 6)), axis=-1).reshape(-1, 2)
WIDTH_M = 0.014


def response(contact_m: np.ndarray, force_n: np.ndarray) -> np.ndarray:
    """(N,42) of single contacts (N,2), (N,), in units of the noise."""
    away2 = ((contact_m[:, None] - FIELDS_M) ** 2).sum(axis=2)
    return 300.0 * np.tanh(force_n / 6.0)[:, None] * np.exp(-0.5 * away2 / WIDTH_M**2)


def toy_table() -> ResponseTable:
    """Tabulated; contacts don't act on one another."""
    grid = TouchGrid.over(EXTENT_M, 4e-3, 8, 6.0)
    contact_m, force_n = grid.presses()
    none = Interplay(np.array([[0.04, 0.03]]), np.array([4e-4]), np.zeros((1, 2, 2)), np.zeros((1, 2, 1, 2)))
    table = ResponseTable.through(grid, response(contact_m[:, 0], force_n[:, 0]), np.zeros((len(force_n), 1)), none)
    return table

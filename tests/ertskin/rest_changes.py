"""Made-up contacts and places not yet recovered, for what changes between rest frames."""

from __future__ import annotations

import numpy as np

CONTACTS, NUMBERS, FRAMES = 8, 60, 30


def columns_and_traces(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(P,L+1) derivatives, (R,P,3) orthonormal imprints that share much with the contacts' columns."""
    columns = rng.standard_normal((NUMBERS, CONTACTS + 1))
    near = columns[:, rng.integers(0, CONTACTS, (FRAMES, 3))].transpose(1, 0, 2)
    traces = np.linalg.qr(near + 0.7 * rng.standard_normal((FRAMES, NUMBERS, 3)))[0]
    traces[0] = 0.0
    return columns, traces


def unsolved(ohm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where no contact goes so far that the sheet is solved."""
    raise AssertionError("no contact settles far")

"""What no name explains, predicted all the same: a Gaussian process of place, force and history, apart from the names.

Kennedy and O'Hagan (J. R. Stat. Soc. B 63 (2001) 425). It says how much of the remainder is the skin's doing, and
repeats, rather than chance; it names nothing.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.history import History, Phase

Array = NDArray[np.float64]

COMPONENTS = 12
MOST_FRAMES = 400


def remainder(history: History, residual: Array, elsewhere: History) -> Array:
    """(n,P) what the residual (T,P) of fitted frames, in units of the noise, makes one expect in other frames (n)."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    known = _features(history)
    middle, spread = known.mean(axis=0), np.where(known.std(axis=0) > 0, known.std(axis=0), 1.0)
    basis = np.linalg.svd(residual, full_matrices=False)[2][:COMPONENTS]
    size = np.maximum((residual @ basis.T).std(axis=0), 1e-12)
    rows = np.unique(np.linspace(0, len(residual) - 1, MOST_FRAMES).astype(int))
    kernel = ConstantKernel(1.0) * RBF(np.ones(known.shape[1]), (0.1, 100.0)) + WhiteKernel(0.3, (1e-3, 10.0))
    process = GaussianProcessRegressor(kernel, random_state=0)
    with warnings.catch_warnings():
        # A length at its bound says that the remainder doesn't depend on that feature.
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(((known - middle) / spread)[rows], (residual @ basis.T / size)[rows])
    expected = process.predict((_features(elsewhere) - middle) / spread)
    return np.asarray(expected.reshape(len(elsewhere), -1) * size @ basis)


def _features(history: History) -> Array:
    """(T,6) place, force, which way the stage goes, time since the press began, time of recording."""
    begun = {press: history.time_s[history.press == press].min() for press in np.unique(history.press)}
    since = history.time_s - np.array([begun[press] for press in history.press])
    place = np.nan_to_num(history.contact_m[:, 0])
    force = np.nan_to_num(history.force_n).sum(axis=1)
    unloading = (history.phase == Phase.UNLOADING).astype(float)
    return np.column_stack([place, np.log1p(np.maximum(force, 0.0)), unloading, np.log1p(since), history.time_s])

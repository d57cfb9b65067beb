"""One foam coupon's test, with what is fitted and what is held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ertskin.diagnosis.coupon.compression import Compression, prepared
from ertskin.diagnosis.coupon.diagnosis import earlier, regimes
from ertskin.hardware.measurement import Coupon
from ertskin.hardware.recording import read_recording

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Specimen:
    """A coupon with free sides; ``fast`` and ``slow`` (N,) are the samples fitted and those held out."""

    coupon: Coupon
    test: Compression
    fast: Rows
    slow: Rows

    @classmethod
    def read(cls, data: Path, number: int) -> Specimen:
        """``data``/real/foam_turbo_free_``number``.h5."""
        coupon = read_recording(data / "real" / f"foam_turbo_free_{number}.h5").coupon
        assert coupon is not None
        test = prepared(coupon)
        fast, slow, _ = regimes(test)
        return cls(coupon, test, fast, slow)

    @property
    def early(self) -> Rows:
        """(N,) the samples in the first two thirds of the fast cycles."""
        return earlier(self.test, self.fast)

    def rmse_n(self, force_n: Array, rows: Rows) -> float:
        """Root mean square error of a prediction (N,) over the samples ``rows``, in newton."""
        return float(np.sqrt(((force_n - self.test.force_n)[rows] ** 2).mean()))


Prediction = Callable[[Specimen], Array]
"""(N,) force in newton of a specimen's whole test."""
Fit = Callable[[list[Specimen], list[Rows]], Prediction]
"""Parameters shared by specimens, fitted to some samples (N,) of each."""

"""The skin as the posterior over contacts takes it: a tabulated response in units of the noise, and its errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.noise.directions import nearest_directions
from ertskin.physics.touch.search import TouchPosterior
from ertskin.physics.touch.table import ResponseTable

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelError:
    """What a response may err by, as ``TouchPosterior`` takes it: ``shape_spread`` (3,), and ``error`` (3,) of x, y
    (metre) and along its slope by force, as a share of the response."""

    shape_spread: Array
    remainder: float
    error: Array


@dataclass(frozen=True, eq=False)
class TouchModel:
    """``table`` in D coordinates, ``matrix`` (n,D) from whitened changes in volt to those, ``error`` of the table.

    ``unseen_v`` (M,n): whitened changes of the presses it was corrected by, each as it would have differed had its
    place been left out. ``whole``: the same in all n coordinates, where these are fewer.
    """

    table: ResponseTable
    matrix: Array
    error: ModelError
    unseen_v: Array
    whole: TouchModel | None = None

    def strongest(self, components: int) -> TouchModel:
        """The same in the first ``components`` coordinates."""
        kept = min(components, self.matrix.shape[1])
        return self._seen(np.eye(self.matrix.shape[1])[:, :kept])

    def along(self, directions: Array) -> TouchModel:
        """The same in coordinates as near as can be to ``directions`` (n,D) of another noise, white in this one."""
        whole = self.whole or self
        return whole._seen(nearest_directions(whole.matrix, directions))

    def _seen(self, turned: Array) -> TouchModel:
        return replace(self, table=self.table.seen(turned), matrix=self.matrix @ turned, whole=self)

    def posterior(self, least_force_n: float) -> TouchPosterior:
        """Contacts of at least that force."""
        return TouchPosterior(
            self.table, self.error.shape_spread, self.error.remainder, self.error.error, least_force_n
        )

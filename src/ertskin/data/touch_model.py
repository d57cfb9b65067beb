"""The skin as the posterior over contacts takes it: a tabulated response in units of the noise, and its errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ertskin.physics.noise.directions import nearest_directions
from ertskin.physics.touch.search import TouchPosterior
from ertskin.physics.touch.table import ResponseTable

Array = NDArray[np.float64]

STATED = 0.9
"""Probability of the regions that are held to the presses left out."""


@dataclass(frozen=True, eq=False)
class ModelError:
    """What a response may err by, as ``TouchPosterior`` takes it: ``shape_spread`` (3,), and ``error`` (3,) of x, y
    (metre) and along its slope by force, as a share of the response, or (4,), a share of the force with it;
    ``widening`` of the covariances all this gives, but for that share of the force."""

    shape_spread: Array
    remainder: float
    error: Array
    widening: float = 1.0


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
        return replace(whole._seen(nearest_directions(whole.matrix, directions)), error=self.error)

    def _seen(self, turned: Array) -> TouchModel:
        return replace(self, table=self.table.seen(turned), matrix=self.matrix @ turned, whole=self)

    def posterior(self, least_force_n: float) -> TouchPosterior:
        """Contacts of at least that force."""
        error = self.error
        return TouchPosterior(
            self.table, error.shape_spread, error.remainder, error.error, least_force_n, widening=error.widening
        )

    def with_force_error(self, share: float) -> TouchModel:
        """With forces stated as uncertain as a load cell whose scale may be off by ``share`` (one sigma) makes them."""
        return replace(self, error=replace(self.error, error=np.append(self.error.error[:3], share)))

    def widened(self, contact_m: Array, force_n: Array, least_force_n: float) -> TouchModel:
        """With covariances as wide as the presses it was corrected by, at (M,2) with (M,) newton, say: ``STATED`` of
        the regions hold a press at one place more, located by a response that is corrected without it. Never narrower
        than before."""
        real = np.column_stack([contact_m, force_n])
        said = self.posterior(least_force_n).of(self.unseen_v @ self.matrix, real[:, None])
        found = np.isfinite(said.force_n).sum(axis=1) == 1
        error = np.column_stack([said.contact_m[:, 0], said.force_n[:, 0]]) - real
        solved = np.linalg.solve(said.covariance[found, 0], error[found, :, None])[..., 0]
        away = (error[found] * solved).sum(axis=1)
        if not found.any():
            return self
        share = share_to_hold(len(np.unique(contact_m[found], axis=0)))
        widening = float(np.quantile(away, share) / chi2.ppf(STATED, 3))
        return replace(self, error=replace(self.error, widening=max(1.0, self.error.widening * widening)))


def share_to_hold(places: int) -> float:
    """Of presses at so many places, the share that regions must hold for ``STATED`` of them to hold one more.

    The quantile of conformal prediction (Lei et al., J. Am. Stat. Assoc. 113 (2018) 1094): the new one is as likely to
    come at any rank among them. All of them where there are too few to say.
    """
    return min(1.0, np.ceil((places + 1) * STATED) / places)

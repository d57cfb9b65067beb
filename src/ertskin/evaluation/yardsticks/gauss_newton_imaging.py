"""One-step Gauss-Newton imaging: the sheet's conductivity change, then a force per taxel (Cheney et al. 1990)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Self

import numpy as np
from scipy.optimize import isotonic_regression

from ertskin.evaluation.yardsticks.held_out_regime import force_bands
from ertskin.evaluation.yardsticks.peaks import highest_near
from ertskin.evaluation.yardsticks.yardstick import Array

PENALTIES = tuple(10.0 ** np.arange(-7.0, 1.0))


class GaussNewtonImaging:
    """Linear reconstruction by the forward model's Jacobian, read at the taxels and turned into newton.

    ``jacobian_v`` (P,G): whitened change in volt per unit of conductivity change in each of G pixels at ``pixel_m``
    (G,2). The penalty is NOSER's: the diagonal of J'J. A taxel's image value is the mean over pixels within
    ``footprint_m``; only taxels above all their neighbours count as contacts; an increasing curve per taxel, learned
    from the rows with one contact, turns image values into newton. The penalty's weight is tuned on held-out forces.
    """

    name = "Gauss-Newton imaging"

    def __init__(
        self,
        jacobian_v: Array,
        pixel_m: Array,
        taxel_m: Array,
        footprint_m: float = 0.008,
        penalties: Sequence[float] = PENALTIES,
    ):
        self.jacobian_v, self.penalties = jacobian_v, penalties
        near = np.linalg.norm(taxel_m[:, None] - pixel_m, axis=-1) <= footprint_m
        if not near.any(axis=1).all():
            raise ValueError("a taxel has no pixel within the footprint: use smaller pixels or a larger footprint")
        self.footprint = near / near.sum(axis=1, keepdims=True)
        apart_m = np.linalg.norm(taxel_m[:, None] - taxel_m, axis=-1)
        pitch_m = apart_m[~np.eye(len(taxel_m), dtype=bool)].min()
        self.neighbours = (apart_m < 1.5 * pitch_m) & ~np.eye(len(taxel_m), dtype=bool)

    def fit(self, change_v: Array, force_map_n: Array) -> Self:
        """Tunes the penalty on held-out force bands of the one-contact rows and learns the curves from all of them."""
        one = (force_map_n > 0).sum(axis=1) == 1
        change_v, force_map_n = change_v[one], force_map_n[one]
        errors = []
        bands = list(force_bands(force_map_n))
        for penalty in self.penalties:
            self._reconstruct_with(penalty)
            image = self._at_taxels(change_v)
            error = 0.0
            for train, test in bands:
                self._learn_curves(image[train], force_map_n[train])
                error += float(np.sum((self._force_n(image[test]) - force_map_n[test]) ** 2))
            errors.append(error)
        self.penalty_ = float(self.penalties[int(np.argmin(errors))])
        self._reconstruct_with(self.penalty_)
        self._learn_curves(self._at_taxels(change_v), force_map_n)
        return self

    def predict(self, change_v: Array) -> Array:
        """(N,n) newton, 0 where the image has no peak."""
        return self._force_n(self._at_taxels(change_v))

    def _force_n(self, image: Array) -> Array:
        """(N,n) newton of images (N,n) at the taxels, 0 where there is no peak."""
        force_n = np.stack([curve(column) for curve, column in zip(self.curves_, image.T, strict=True)], axis=1)
        return np.where(force_n >= highest_near(force_n, self.neighbours), force_n, 0.0)

    def image(self, change_v: Array) -> Array:
        """(N,G) the reconstructed change of conductivity, in the Jacobian's unit."""
        return change_v @ self.reconstruction_.T

    def _reconstruct_with(self, penalty: float) -> None:
        """Sets the (G,P) matrix (J'J + penalty diag J'J)^-1 J', solved in the smaller of the two dimensions."""
        scale, left, singular, right = self._parts
        damped = singular / (singular**2 + penalty * singular[0] ** 2)
        self.reconstruction_ = scale[:, None] * ((right.T * damped) @ left.T)

    @cached_property
    def _parts(self) -> tuple[Array, Array, Array, Array]:
        """The penalty's scale (G,), and the singular value decomposition of the Jacobian in it."""
        scale = 1.0 / np.sqrt(np.einsum("pg,pg->g", self.jacobian_v, self.jacobian_v))
        return scale, *np.linalg.svd(self.jacobian_v * scale, full_matrices=False)

    def _at_taxels(self, change_v: Array) -> Array:
        return self.image(change_v) @ self.footprint.T

    def _learn_curves(self, image: Array, force_map_n: Array) -> None:
        """One increasing curve per taxel from image value (N,n) to newton; 0 N at no change, linear beyond the last
        point."""
        self.curves_ = [
            Curve(image[touched, taxel], force_map_n[touched, taxel])
            for taxel, touched in enumerate((force_map_n > 0).T)
        ]


class Curve:
    """An increasing curve through the origin; a taxel never pressed in training stays at 0 N."""

    def __init__(self, image: Array, force_n: Array):
        level = np.concatenate([[0.0], image])
        step, place, rows = np.unique(level, return_inverse=True, return_counts=True)
        mean_n = np.bincount(place, np.concatenate([[0.0], force_n])) / rows
        rising_n = isotonic_regression(mean_n, weights=rows).x
        # Isotonic steps follow the noise of single rows; a dozen quantiles joined by lines don't.
        self.level = np.unique(np.concatenate([[0.0], np.quantile(np.maximum(level, 0.0), np.linspace(0, 1, 12))]))
        self.force_n = np.interp(self.level, step, rising_n)
        self.force_n[0] = 0.0

    def __call__(self, image: Array) -> Array:
        inside = np.interp(image, self.level, self.force_n)
        if len(self.level) < 2:
            return inside
        slope = (self.force_n[-1] - self.force_n[-2]) / (self.level[-1] - self.level[-2])
        return inside + slope * np.maximum(image - self.level[-1], 0.0)

"""The force of a single touch, read off the taxel's own response curve.

One contact moves the reciprocal numbers along a curve, the force its parameter. Where exactly one taxel is touched,
the most likely force is that of the curve's nearest point in units of the noise: sharper than a network that must
also keep two contacts apart.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ertskin.data.trials import TrialSet

FEWEST = 6
"""One-point trials a taxel's curve takes at least."""


class SingleTouch(nn.Module):
    """Curves (n,levels,K) of n taxels over forces (levels,) from none to the largest; unknown until fitted."""

    curve: Tensor
    force_n: Tensor
    known: Tensor

    def __init__(self, taxels: int, components: int, levels: int = 101) -> None:
        super().__init__()
        self.register_buffer("curve", torch.zeros(taxels, levels, components))
        self.register_buffer("force_n", torch.linspace(0.0, 1.0, levels))
        self.register_buffer("known", torch.zeros(1))

    def fit(self, trials: TrialSet, whitened: Tensor) -> None:
        """From the one-point trials among ``trials`` and their inputs (N,K); left unknown where they are too few."""
        single = np.flatnonzero(trials.contacts == 1)
        taxel, force = trials.force_map_n[single].argmax(axis=1), trials.force_map_n[single].max(axis=1)
        taxels, levels, components = self.curve.shape
        if np.bincount(taxel, minlength=taxels).min() < FEWEST:
            return
        grid = np.linspace(0.0, force.max(), levels)
        values = whitened[torch.from_numpy(single)].numpy()
        for k in range(taxels):
            rows = np.flatnonzero(taxel == k)
            rows = rows[np.argsort(force[rows])]
            known = np.concatenate([np.zeros((1, components)), values[rows]])
            at = np.r_[0.0, force[rows]]
            curve = np.stack([np.interp(grid, at, column) for column in known.T], axis=1)
            self.curve[k] = torch.from_numpy(curve)
        self.force_n.copy_(torch.from_numpy(grid))
        self.known.fill_(1.0)

    def forward(self, whitened: Tensor, logit: Tensor, force_n: Tensor, threshold: float) -> Tensor:
        """(N,n) forces in newton: those given, with a single touch's replaced by its curve's answer."""
        best = logit.argmax(dim=1)
        # Worked out for single touches alone: there is an interval of a curve for each of its levels to look at.
        rows = ((torch.sigmoid(logit) > threshold).sum(dim=1) == 1).nonzero()[:, 0]
        chosen = best[rows]
        start, step = self.curve[:, :-1], self.curve[:, 1:] - self.curve[:, :-1]
        away, along = whitened[rows, None] - start[chosen], step[chosen]
        share = ((away * along).sum(dim=2) / along.square().sum(dim=2).clamp(min=1e-12)).clamp(0.0, 1.0)
        distance = (away - share[..., None] * along).square().sum(dim=2)
        nearest = distance.argmin(dim=1, keepdim=True)
        answer = (nearest + share.gather(1, nearest))[:, 0] * (self.force_n[1] - self.force_n[0])
        answer = torch.where(self.known > 0, answer, force_n[rows, chosen])
        return force_n.index_put((rows, chosen), answer)

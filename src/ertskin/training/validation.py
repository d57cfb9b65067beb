"""The metrics of a reconstruction on the simulated trials it was not trained on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ertskin.data.material import Material
from ertskin.data.split import split
from ertskin.evaluation.metrics import Score
from ertskin.evaluation.predictions import evaluate_predictions
from ertskin.models.estimate import Estimate
from ertskin.models.reconstruction import Reconstruction
from ertskin.training.settings import TrainerSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Validation:
    """``scores`` by metric name, and the estimates they come from beside the true force maps (N,n) in newton.

    ``change_v`` (N,P): whitened coordinates of the trials, noise included, of contacts ``contact_m`` (N,C,2) with
    ``force_n`` (N,C).
    """

    scores: dict[str, Score]
    change_v: NDArray[np.float64]
    contact_m: NDArray[np.float64]
    force_n: NDArray[np.float64]
    taxel_m: NDArray[np.float64]
    true_map_n: NDArray[np.float64]
    estimate: Estimate

    def figures(self) -> dict[str, Figure]:
        """File name -> figure: estimated against true force of one contact, and what differs from taxel to taxel."""
        from ertskin.report.figures.force_scatter import force_scatter
        from ertskin.report.figures.taxel_map import taxel_map

        touched = self.true_map_n > 0
        drawn = {}
        if (one := touched.sum(axis=1) == 1).any():
            estimated_n = self.estimate.force_map_n[one][touched[one]]
            missed = ~self.estimate.present[one][touched[one]]
            drawn["force_one.png"] = force_scatter(self.true_map_n[one][touched[one]], estimated_n, missed)
        for name, label in (("hit_rate_one", "hit rate"), ("force_rmse_one_n", "force RMSE / N")):
            if name in self.scores and np.isfinite(self.scores[name].per_taxel).any():
                drawn[f"{name}.png"] = taxel_map(self.taxel_m, self.scores[name].per_taxel, label)
        return drawn


def validate(reconstruction: Reconstruction, material: Material, settings: TrainerSettings) -> Validation:
    """Over at most ``network.validated`` validation trials, each with noise of its own."""
    _, rows = split(len(material.trials), settings.seed, settings.training_share)
    rng = np.random.default_rng(np.random.SeedSequence([settings.seed, 3]))
    trials = material.trials[np.sort(rng.permutation(rows)[: reconstruction.network.validated])]
    if reconstruction.network.reads == "coordinates":
        change_v = trials.coordinates_v(material.protocol) + material.noise.coordinates(rng, len(trials))
        estimate = reconstruction.estimate_coordinates(change_v)
    else:
        readings_v = trials.readings_v(material.protocol) + material.noise.readings(rng, len(trials))
        change_v = readings_v @ material.protocol.orthonormal
        estimate = reconstruction.estimate(readings_v)
    scores = evaluate_predictions(
        trials.force_map_n,
        estimate.force_map_n,
        material.taxel_m,
        present=estimate.present,
        contact_m=trials.contact_m,
        located_m=estimate.contact_m,
    )
    true = trials.contact_m, trials.force_n
    return Validation(scores, change_v, *true, material.taxel_m, trials.force_map_n, estimate)

"""The metrics of a reconstruction on the simulated trials it was not trained on."""

from __future__ import annotations

import numpy as np

from ertskin.data.material import Material
from ertskin.data.split import split
from ertskin.evaluation.metrics import Score
from ertskin.evaluation.predictions import evaluate_predictions
from ertskin.models.reconstruction import Reconstruction
from ertskin.training.settings import TrainerSettings

MOST_TRIALS = 2000


def validation_scores(
    reconstruction: Reconstruction, material: Material, settings: TrainerSettings
) -> dict[str, Score]:
    """Scores by metric name over at most ``MOST_TRIALS`` validation trials, each with noise of its own."""
    _, rows = split(len(material.trials), settings.seed, settings.training_share)
    rng = np.random.default_rng(np.random.SeedSequence([settings.seed, 3]))
    trials = material.trials[np.sort(rng.permutation(rows)[:MOST_TRIALS])]
    if reconstruction.network.reads == "coordinates":
        change_v = trials.coordinates_v(material.protocol) + material.noise.coordinates(rng, len(trials))
        estimate = reconstruction.estimate_coordinates(change_v)
    else:
        estimate = reconstruction.estimate(
            trials.readings_v(material.protocol) + material.noise.readings(rng, len(trials))
        )
    return evaluate_predictions(
        trials.force_map_n,
        estimate.force_map_n,
        material.taxel_m,
        present=estimate.present,
        contact_m=trials.contact_m,
        located_m=estimate.contact_m,
    )

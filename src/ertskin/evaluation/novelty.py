"""How many test frames are unlike all that a network was trained on."""

from __future__ import annotations

from typing import TYPE_CHECKING
from typing import Protocol as Interface

import numpy as np
from numpy.typing import NDArray

from ertskin.evaluation.metrics.score import Score
from ertskin.models.novelty import unexplained_of

if TYPE_CHECKING:
    from ertskin.models.estimate import Estimate
    from ertskin.models.reconstruction import Reconstruction

Array = NDArray[np.float64]
NOVEL = "novel_rate"


class Frames(Interface):
    """N frames: whitened changes (N,n), raw changes (N,R), and how well their zero is known."""

    @property
    def change_v(self) -> Array: ...
    @property
    def readings_v(self) -> NDArray[np.floating]: ...
    @property
    def zero_variance(self) -> Array: ...
    @property
    def rest_frames(self) -> int: ...


def novelty_of(trained: Reconstruction, frames: Frames, estimate: Estimate) -> Array | None:
    """(N,) scores, beyond 1 once in a thousand frames of a skin as trained; None of a network without a monitor."""
    if trained.monitor is None:
        return None
    novelty, basis = trained.monitor.novelty, trained.protocol.orthonormal
    flat = np.asarray(frames.readings_v, dtype=float)
    leftover_v = flat - (flat @ basis) @ basis.T
    spare = int(basis.any(axis=1).sum()) - basis.shape[1]
    unexplained = unexplained_of(leftover_v, novelty.noise_v, spare, frames.rest_frames)
    return novelty.score(frames.change_v, estimate.misfit, unexplained, frames.zero_variance)


def novel_rate(score: Array | None, taxel_m: Array, name: str = NOVEL) -> dict[str, Score]:
    """Share of frames beyond the limit, by name; nothing where there are no scores."""
    if score is None or not len(score):
        return {}
    return {name: Score(name, float(np.mean(score > 1.0)), np.full(len(taxel_m), np.nan))}

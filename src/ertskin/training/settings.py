"""How a network is trained."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrainerSettings:
    """``batch`` trials a step of Adam at ``learning_rate``, for ``max_epochs`` or until ``patience`` epochs in a row
    bring the validation loss no lower. ``annealed``: the rate falls to zero along half a cosine over ``max_epochs``.
    ``batches_per_chunk`` changes the speed alone. ``threads``: of this job; with two or more a denoiser and its network
    are trained side by side. Results are bit-identical for the same number. ``accelerator``: ``cpu``, ``gpu``, or
    ``auto`` for a GPU where there is one. ``checkpoint_s``: most time lost to a kill within an epoch, whose end is
    always kept.
    """

    batch: int = 32
    learning_rate: float = 1e-3
    max_epochs: int = 100
    patience: int = 10
    annealed: bool = False
    training_share: float = 0.85
    batches_per_chunk: int = 64
    threads: int = 1
    accelerator: str = "auto"
    checkpoint_s: float = 30.0
    seed: int = 0

"""How a network is trained."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ertskin.settings import checked, limited, whole_number
from ertskin.training.accelerator import check_accelerator

LARGEST_SEED = 2**32 - 1


@dataclass(frozen=True)
class TrainerSettings:
    """``batch`` trials a step of Adam at ``learning_rate``, for ``max_epochs`` or until ``patience`` epochs in a row
    bring the validation loss no lower. ``annealed``: the rate falls to zero along half a cosine over ``max_epochs``.
    ``batches_per_chunk`` changes the speed alone. ``threads``: of this job; with two or more a denoiser and its network
    are trained side by side. Results are bit-identical for the same number. ``accelerator``: ``cpu``, ``gpu``, or
    ``auto`` for a GPU (CUDA, ROCm) where there is one. ``checkpoint_s``: most time lost to a kill within an epoch,
    whose end is always kept.
    """

    batch: int = limited(32, least=2)
    learning_rate: float = limited(1e-3, above=0)
    max_epochs: int = limited(100, least=1)
    patience: int = limited(10, least=1)
    annealed: bool = False
    training_share: float = limited(0.85, above=0, most=0.99)
    batches_per_chunk: int = limited(64, least=1)
    threads: int = limited(1, least=1)
    accelerator: str = limited("auto", one_of=("auto", "cpu", "gpu"))
    checkpoint_s: float = limited(30.0, least=0)
    seed: int = limited(0, least=0, most=LARGEST_SEED)


def trainer_settings(section: Any, seed: Any) -> TrainerSettings:
    """From the group ``trainer`` and the seed; ``UserError`` for a wrong value or a GPU that isn't there."""
    settings = checked(TrainerSettings, section, "trainer")
    check_accelerator(settings.accelerator)
    return replace(settings, seed=whole_number(seed, "seed", least=0, most=LARGEST_SEED))

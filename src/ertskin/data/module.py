"""The Lightning data module over trials in memory."""

from __future__ import annotations

import lightning.pytorch as pl
import torch

from ertskin.data.batches import Chunks, InOrder
from ertskin.data.split import TRAINING_SHARE, split
from ertskin.data.tensors import TrialTensors


class TrialModule(pl.LightningDataModule):
    """Trials split into training and validation by ``seed``; ``batches`` mini-batches make one step's chunk."""

    def __init__(
        self,
        trials: TrialTensors,
        *,
        batch: int = 32,
        batches: int = 16,
        seed: int = 0,
        training_share: float = TRAINING_SHARE,
    ) -> None:
        super().__init__()
        self.trials, self.batch, self.batches, self.seed = trials, batch, batches, seed
        training, validation = split(len(trials), seed, training_share)
        self.training_rows, self.validation_rows = torch.from_numpy(training), torch.from_numpy(validation)

    def setup(self, stage: str) -> None:
        """Put the trials on the training device, once."""
        if self.trainer is not None:
            self.trials = self.trials.to(self.trainer.strategy.root_device)

    def train_dataloader(self) -> Chunks:
        """Chunks of shuffled mini-batches."""
        return Chunks(self.trials, self.training_rows, self.batch, self.batches, self.seed)

    def val_dataloader(self) -> InOrder:
        """The validation trials, in order, in large batches."""
        return InOrder(self.trials, self.validation_rows)

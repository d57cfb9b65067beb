"""Tells how a training goes: a line now and then for a person, every epoch's numbers for the record."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import lightning.pytorch as pl

from ertskin.models.network import Network

Log = Callable[[dict[str, float], int], None]


class Progress(pl.Callback):
    """Hands each epoch's losses to ``log(metrics, epoch)``, and says the validation's at most every ``every_s``."""

    def __init__(self, title: str, log: Log | None, every_s: float = 5.0) -> None:
        self.title, self.log_epoch, self.every_s = title, log, every_s
        self._said_s = time.monotonic()

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """After the epoch's validation."""
        assert isinstance(pl_module, Network)
        metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
        training_loss = pl_module.taken_training_loss()
        if self.log_epoch is not None:
            self.log_epoch({"training_loss": training_loss, **metrics}, trainer.current_epoch)
        if time.monotonic() - self._said_s >= self.every_s:
            self._said_s = time.monotonic()
            losses = ", ".join(f"{name.removeprefix('validation_')} {value:.4g}" for name, value in metrics.items())
            epoch = f"epoch {trainer.current_epoch + 1} of at most {trainer.max_epochs}"
            print(f"{self.title}: {epoch}: {losses}", file=sys.stderr, flush=True)

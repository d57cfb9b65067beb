"""A checkpoint from which training goes on as if it had never stopped."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import lightning.pytorch as pl
import torch
from lightning.pytorch.callbacks import Checkpoint

LAST, BEST = "last.ckpt", "best.pt"


class ExactCheckpoint(Checkpoint):
    """Keeps ``last.ckpt`` after every epoch and the weights of the best epoch in ``best.pt``.

    Lightning stores weights, optimizer, counters and the loader's place; the states of the random generators, without
    which dropout would differ, are added here. Both files are written aside and renamed, the best weights first: a
    kill in between repeats the epoch, with the same outcome.
    """

    def __init__(self, folder: Path, monitor: str = "validation_loss") -> None:
        self.folder, self.monitor = folder, monitor
        self.best_loss, self.best_epoch, self.finished = float("inf"), -1, False
        self._generators: dict[str, Any] = {}

    def on_fit_start(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """Restore the generators: after Lightning has loaded the rest, before anything is drawn."""
        if not self._generators:
            return
        torch.set_rng_state(self._generators["cpu"])
        if torch.cuda.is_available() and self._generators["cuda"]:
            torch.cuda.set_rng_state_all(self._generators["cuda"])

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """Write the checkpoints; runs after the callback that decides whether to stop."""
        loss = float(trainer.callback_metrics[self.monitor])
        if loss < self.best_loss:
            self.best_loss, self.best_epoch = loss, trainer.current_epoch
            _write(pl_module.state_dict(), self.folder / BEST)
        self.finished = trainer.should_stop or trainer.current_epoch + 1 == trainer.max_epochs
        aside = self.folder / f"{LAST}.part"
        trainer.save_checkpoint(aside)
        os.replace(aside, self.folder / LAST)

    def state_dict(self) -> dict[str, Any]:
        """Best epoch so far, whether training is through, and the generators' states."""
        cuda = torch.cuda.get_rng_state_all() if torch.cuda.is_available() else []
        return {
            "best_loss": self.best_loss,
            "best_epoch": self.best_epoch,
            "finished": self.finished,
            "generators": {"cpu": torch.get_rng_state(), "cuda": cuda},
        }

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """The counterpart of ``state_dict``; the generators wait for ``on_fit_start``."""
        self.best_loss, self.best_epoch = state_dict["best_loss"], state_dict["best_epoch"]
        self.finished, self._generators = state_dict["finished"], state_dict["generators"]


def _write(content: object, path: Path) -> None:
    aside = path.with_name(path.name + ".part")
    torch.save(content, aside)
    os.replace(aside, path)

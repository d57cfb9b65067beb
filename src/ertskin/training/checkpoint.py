"""A checkpoint from which training goes on as if it had never stopped."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import lightning.pytorch as pl
import torch
from lightning.pytorch.callbacks import Checkpoint

LAST, BEST = "last.ckpt", "best.pt"


class ExactCheckpoint(Checkpoint):
    """Keeps ``last.ckpt`` after every epoch, and within one every ``every_s``; the best epoch's weights in ``best.pt``.

    Lightning stores weights, optimizer and counters. Added here: the states of the random generators, without which
    dropout would differ, and the loader's place, which Lightning forgets when it resumes at an epoch's end. Both files
    are written aside and renamed, the best weights first: a kill in between repeats the epoch, with the same outcome.
    """

    def __init__(self, folder: Path, every_s: float = 30.0, monitor: str = "validation_loss") -> None:
        self.folder, self.every_s, self.monitor = folder, every_s, monitor
        self._saved_s = time.monotonic()
        self.best_loss, self.best_epoch, self.finished = float("inf"), -1, False
        self._generators: dict[str, Any] = {}
        self._place: dict[str, int] = {}
        self._loader: Any = None

    def on_fit_start(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """Restore the generators: after Lightning has loaded the rest, before anything is drawn."""
        if not self._generators:
            return
        torch.set_rng_state(self._generators["cpu"])
        if torch.cuda.is_available() and self._generators["cuda"]:
            torch.cuda.set_rng_state_all(self._generators["cuda"])

    def on_train_start(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """Move the loader, which exists by now, to its place."""
        self._loader = trainer.train_dataloader
        if self._place:
            self._loader.load_state_dict(self._place)

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """Write the checkpoints; runs after the callback that decides whether to stop."""
        loss = float(trainer.callback_metrics[self.monitor])
        if loss < self.best_loss:
            self.best_loss, self.best_epoch = loss, trainer.current_epoch
            _write(pl_module.state_dict(), self.folder / BEST)
        self.finished = trainer.should_stop or trainer.current_epoch + 1 == trainer.max_epochs
        self._save(trainer)

    def on_train_batch_end(self, trainer: pl.Trainer, *args: Any) -> None:
        """Write a checkpoint within a long epoch; the last chunk's is left to the epoch's end."""
        if time.monotonic() - self._saved_s >= self.every_s and not trainer.is_last_batch:
            self._save(trainer)

    def _save(self, trainer: pl.Trainer) -> None:
        aside = self.folder / f"{LAST}.part"
        trainer.save_checkpoint(aside)
        os.replace(aside, self.folder / LAST)
        self._saved_s = time.monotonic()

    def state_dict(self) -> dict[str, Any]:
        """Best epoch so far, whether training is through, the generators' states and the loader's place."""
        cuda = torch.cuda.get_rng_state_all() if torch.cuda.is_available() else []
        return {
            "best_loss": self.best_loss,
            "best_epoch": self.best_epoch,
            "finished": self.finished,
            "generators": {"cpu": torch.get_rng_state(), "cuda": cuda},
            "place": self._loader.state_dict(),
        }

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """The counterpart of ``state_dict``; generators and place wait for what they belong to."""
        self.best_loss, self.best_epoch = state_dict["best_loss"], state_dict["best_epoch"]
        self.finished, self._generators, self._place = (state_dict[key] for key in ("finished", "generators", "place"))


def _write(content: object, path: Path) -> None:
    aside = path.with_name(path.name + ".part")
    torch.save(content, aside)
    os.replace(aside, path)

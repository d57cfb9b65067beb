"""Train one network on tensors, going on from where an earlier attempt was cut off."""

from __future__ import annotations

import logging
import sys
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import lightning.pytorch as pl
import torch
from lightning.pytorch.callbacks import EarlyStopping

from ertskin.data.module import TrialModule
from ertskin.data.tensors import TrialTensors
from ertskin.models.network import Network
from ertskin.training.checkpoint import BEST, LAST, ExactCheckpoint
from ertskin.training.progress import Log, Progress
from ertskin.training.settings import TrainerSettings


@dataclass(frozen=True)
class Fitted:
    """How a training ended: the best validation loss, its epoch from 0, and the folder of its checkpoints."""

    loss: float
    epoch: int
    folder: Path


def fit(
    network: Network,
    trials: TrialTensors,
    settings: TrainerSettings,
    folder: Path,
    *,
    title: str = "training",
    log: Log | None = None,
) -> Fitted:
    """Train ``network`` in place and leave it with the weights of its best epoch.

    The same ``settings`` and ``trials`` give the same weights bit for bit, however often training was killed and
    started again on ``folder``. Raises ``JobFailed`` when the loss is no longer finite.
    """
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(settings.threads)
    network.learning_rate, network.annealed = settings.learning_rate, settings.annealed
    checkpoint = ExactCheckpoint(folder, settings.checkpoint_s)
    last = folder / LAST
    begun = _checkpoint_state(last) if last.is_file() else None
    if begun is None or not begun["finished"]:
        if begun is not None:
            # A checkpoint's place counts chunks of the size it was written with.
            settings = replace(settings, batches_per_chunk=begun["place"]["batches"])
            epoch = f"epoch {begun['place']['epoch'] + 1} of at most {settings.max_epochs}"
            print(f"{title}: going on from {epoch}", file=sys.stderr, flush=True)
        data = _data(trials, settings)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                trainer = _trainer(settings, folder, [Progress(title, log), checkpoint])
                # oneDNN sets itself up at every call: small batches lose more by that than they gain.
                torch.backends.mkldnn.set_flags(False)
                trainer.fit(network, data, ckpt_path=None if begun is None else last, weights_only=True)
        except SystemExit as error:
            # Lightning turns Ctrl-C into an exit of its own.
            if isinstance(error.__context__, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise
    state = _checkpoint_state(last)
    network.load_state_dict(torch.load(folder / BEST, weights_only=True, map_location="cpu"))
    network.cpu().eval()
    return Fitted(state["best_loss"], state["best_epoch"], folder)


def _data(trials: TrialTensors, settings: TrainerSettings) -> TrialModule:
    return TrialModule(
        trials,
        batch=settings.batch,
        batches=settings.batches_per_chunk,
        seed=settings.seed,
        training_share=settings.training_share,
    )


def _trainer(settings: TrainerSettings, folder: Path, callbacks: list[pl.Callback]) -> pl.Trainer:
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    stopping = EarlyStopping("validation_loss", patience=settings.patience, check_finite=False)
    return pl.Trainer(
        accelerator=_accelerator(settings.accelerator),
        devices=1,
        max_epochs=settings.max_epochs,
        deterministic=True,
        callbacks=[stopping, *callbacks],
        default_root_dir=folder,
        logger=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        use_distributed_sampler=False,
    )


def _accelerator(asked: str) -> str:
    """Lightning's name for it: its own "auto" would take Apple's GPUs, which have no double precision."""
    return "cuda" if asked == "gpu" or (asked == "auto" and torch.cuda.is_available()) else "cpu"


def _checkpoint_state(last: Path) -> dict:
    return torch.load(last, weights_only=True, map_location="cpu")["callbacks"]["ExactCheckpoint"]

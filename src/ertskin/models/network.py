"""What all networks share: inputs scaled by what they were trained on, and several mini-batches in one step."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal

import lightning.pytorch as pl
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ertskin.data.batches import Batches
from ertskin.data.tensors import TrialTensors
from ertskin.data.trials import TrialSet
from ertskin.errors import JobFailed, UserError
from ertskin.models.estimate import Estimate
from ertskin.models.scaling import NoiseWhitening
from ertskin.physics.noise.model import Noise
from ertskin.physics.protocol import Protocol
from ertskin.training.adam import LeanAdam

Array = NDArray[np.float64]
Reads = Literal["readings", "coordinates"]
PLACES = ("taxel_m", "answer_m")
"""Where a network's answers lie: its own specimen's, whatever it starts from."""
Gradient = Callable[[Tensor, dict[str, Tensor]], Tensor]
"""Of a mini-batch's inputs and targets: returns the loss, and leaves its gradient in the parameters' ``grad``."""


class Network(pl.LightningModule):
    """A network trained with Adam on chunks of mini-batches.

    Lightning's cost per step exceeds that of a small network's mathematics, so one ``training_step`` takes a chunk of
    mini-batches and makes one Adam step for each: the same steps as one at a time.

    A subclass gives ``prepare`` (fit its input scaling, and turn trials into tensors) and ``losses``. ``reads`` says
    what it takes in: the R raw readings of a scan, or the P whitened coordinates of its reciprocal part.
    """

    reads: ClassVar[Reads] = "readings"
    recalibrates: ClassVar[bool] = False
    """Whether on another specimen its weights do without training: ``prepare`` alone fits it to that."""
    validated: ClassVar[int] = 2000
    """Trials its metrics are taken from."""

    def __init__(self) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.learning_rate = 1e-3
        self.annealed = False
        self.arguments: dict[str, Any] = {}
        self._loss_sum, self._loss_count = 0.0, 0

    taxel_m: Tensor

    @property
    def answers_m(self) -> Array:
        """(n,2) the taxels it answers for."""
        return np.asarray(self.taxel_m.detach().cpu(), dtype=float)

    def prepare(self, protocol: Protocol, trials: TrialSet, noise: Noise, seed: int) -> TrialTensors:
        """Fit the scaling of the inputs on ``trials`` and return them as tensors."""
        raise NotImplementedError

    def start_from(self, other: Network) -> None:
        """Take over what ``other`` learned on another specimen; ``prepare`` then keeps the directions it reads.

        Raises ``UserError`` where that is a network of another kind or of other sizes.
        """
        if type(other) is not type(self):
            raise UserError(f"from: holds a {type(other).__name__}, where this model is a {type(self).__name__}")
        own = {name for name in self.state_dict() if name not in PLACES}
        try:
            self.load_state_dict({name: value for name, value in other.state_dict().items() if name in own}, False)
        except RuntimeError:
            raise UserError(f"from: that network differs in size: {_differing(other, self)}") from None
        for module in self.modules():
            if isinstance(module, NoiseWhitening):
                module.keep()

    def losses(self, inputs: Tensor, targets: dict[str, Tensor]) -> dict[str, Tensor]:
        """Loss terms by name; their sum is minimised. Means over the batch."""
        raise NotImplementedError

    def estimate(self, change_v: Tensor) -> Estimate:
        """Touches of (N,D) voltage changes; for networks that reconstruct."""
        raise NotImplementedError

    def gradient(self) -> Gradient:
        """What a chunk's mini-batches are given to."""
        parameters = list(self.parameters())

        def by_autograd(inputs: Tensor, targets: dict[str, Tensor]) -> Tensor:
            loss = _summed(self.losses(inputs, targets))
            for parameter in parameters:
                parameter.grad = None
            loss.backward()
            return loss.detach()

        return by_autograd

    def training_step(self, batches: Batches, index: int) -> None:
        """One Adam step for each mini-batch of the chunk."""
        optimizer = self.optimizers(use_pl_optimizer=False)
        assert isinstance(optimizer, LeanAdam)
        gradient = self.gradient()
        total = torch.zeros((), device=self.device)
        for inputs, targets in batches:
            total += gradient(inputs, targets)
            optimizer.update()
            self._loss_count += 1
        self._loss_sum += total.item()
        if not math.isfinite(self._loss_sum):
            raise JobFailed(f"the training loss is no longer finite in epoch {self.current_epoch}")

    def taken_training_loss(self) -> float:
        """Mean loss of the mini-batches since this was last asked; NaN without any."""
        mean = self._loss_sum / self._loss_count if self._loss_count else math.nan
        self._loss_sum, self._loss_count = 0.0, 0
        return mean

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keep what of the epoch's loss is summed so far."""
        checkpoint["training_loss"] = {"sum": self._loss_sum, "count": self._loss_count}

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Go on with the epoch's loss."""
        self._loss_sum, self._loss_count = (checkpoint["training_loss"][key] for key in ("sum", "count"))

    def on_train_epoch_start(self) -> None:
        """Lower the learning rate along half a cosine where asked: a function of the epoch alone, as resuming needs."""
        if self.annealed and self.trainer.max_epochs:
            share = self.current_epoch / self.trainer.max_epochs
            for group in self.optimizers(use_pl_optimizer=False).param_groups:  # type: ignore[union-attr]
                group["lr"] = self.learning_rate * 0.5 * (1 + math.cos(math.pi * share))

    def validation_step(self, batches: Batches, index: int) -> None:
        """Mean losses over the validation trials; raises ``JobFailed`` where they are no longer finite."""
        for inputs, targets in batches:
            parts = self.losses(inputs, targets)
            total = _summed(parts)
            if not torch.isfinite(total):
                raise JobFailed(f"the validation loss is no longer finite in epoch {self.current_epoch}")
            named = {"validation_loss": total} | {f"validation_{name}_loss": part for name, part in parts.items()}
            self.log_dict(named, batch_size=len(inputs), on_epoch=True, on_step=False)

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam (paper IV-C)."""
        return LeanAdam(self.parameters(), self.learning_rate)


def _differing(other: Network, network: Network) -> str:
    sizes = [{**one.arguments, "taxels": len(one.answers_m)} for one in (other, network)]
    return ", ".join(
        f"{name} {sizes[0].get(name)} instead of {value}"
        for name, value in sizes[1].items()
        if isinstance(value, int) and sizes[0].get(name) != value
    )


def _summed(parts: dict[str, Tensor]) -> Tensor:
    first, *rest = parts.values()
    return sum(rest, start=first)

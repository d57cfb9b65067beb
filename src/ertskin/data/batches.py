"""Mini-batches drawn from memory, in an order that depends on the seed and the epoch alone."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from ertskin.data.tensors import TrialTensors


class Chunks:
    """Shuffled trials, ``batches`` mini-batches of ``batch`` at a time, remembering where it is.

    Order and noise of epoch e depend on (``seed``, e) alone: what was drawn before, by which process, doesn't matter.
    Length and iteration count chunks. ``state_dict`` names the chunk that comes next, which is what Lightning stores.
    """

    def __init__(self, trials: TrialTensors, rows: Tensor, batch: int, batches: int, seed: int) -> None:
        self.trials, self.rows, self.batch, self.batches, self.seed = trials, rows, batch, batches, seed
        self.size = batch * batches
        self.epoch = self.position = 0

    def __len__(self) -> int:
        return -(-len(self.rows) // self.size)

    def __iter__(self) -> Iterator[Batches]:
        epoch, first = self.epoch, self.position
        order, noise_rows = self._drawn(epoch)
        for position in range(first, len(self)):
            # Moved on before the chunk is handed over: a checkpoint is written while the caller holds the last one.
            last = position + 1 == len(self)
            self.epoch, self.position = (epoch + 1, 0) if last else (epoch, position + 1)
            these = slice(position * self.size, (position + 1) * self.size)
            yield Batches(self.trials, order[these], None if noise_rows is None else noise_rows[these], self.batch)

    def state_dict(self) -> dict[str, int]:
        """Epoch and chunk that come next, and the mini-batches of a chunk."""
        return {"epoch": self.epoch, "position": self.position, "batches": self.batches}

    def load_state_dict(self, state: dict[str, int]) -> None:
        """Go on from there; raises ``ValueError`` where the chunks were of another size."""
        if state["batches"] != self.batches:
            raise ValueError(
                f"chunks of {state['batches']} mini-batches can't be gone on with in those of {self.batches}"
            )
        self.epoch, self.position = state["epoch"], state["position"]

    def _drawn(self, epoch: int) -> tuple[Tensor, Tensor | None]:
        """The epoch's order of the trials and the row of noise each is given."""
        generator = torch.Generator().manual_seed(self.seed * 1_000_003 + epoch)
        order = self.rows[torch.randperm(len(self.rows), generator=generator)]
        device = self.trials.inputs.device
        if self.trials.noise is None:
            return order.to(device), None
        return order.to(device), torch.randint(len(self.trials.noise), order.shape, generator=generator).to(device)


class InOrder:
    """Trials in large batches, always the same: each keeps one row of noise, so that losses compare between epochs."""

    def __init__(self, trials: TrialTensors, rows: Tensor, batch: int = 1024) -> None:
        self.trials, self.rows, self.batch = trials, rows, batch

    def __len__(self) -> int:
        return -(-len(self.rows) // self.batch)

    def __iter__(self) -> Iterator[Batches]:
        for rows in self.rows.to(self.trials.inputs.device).split(self.batch):
            noise_rows = None if self.trials.noise is None else rows % len(self.trials.noise)
            yield Batches(self.trials, rows, noise_rows, self.batch)


class Batches:
    """Mini-batches of the trials in ``rows``, each trial with its row of noise, gathered one at a time.

    A mini-batch so stays in the processor's cache until it has been used. The last one may be short.
    """

    def __init__(self, trials: TrialTensors, rows: Tensor, noise_rows: Tensor | None, batch: int) -> None:
        self.trials, self.rows, self.noise_rows, self.batch = trials, rows, noise_rows, batch

    def __iter__(self) -> Iterator[tuple[Tensor, dict[str, Tensor]]]:
        """Yields (inputs, targets); a batch of one trial is left out: it has no statistics."""
        trials = self.trials
        for start in range(0, len(self.rows), self.batch):
            rows = self.rows[start : start + self.batch]
            if len(rows) < 2:
                continue
            inputs = trials.inputs.index_select(0, rows)
            if trials.noise is not None and self.noise_rows is not None:
                inputs += trials.noise.index_select(0, self.noise_rows[start : start + self.batch])
            yield inputs, {name: value.index_select(0, rows) for name, value in trials.targets.items()}

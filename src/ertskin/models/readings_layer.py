"""A linear layer on the readings of a scan that learns from the few numbers behind them."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.sparse import csr_array
from torch import Tensor, nn
from torch.nn.functional import embedding_bag

Array = NDArray[np.float64]
Bags = tuple[Tensor, Tensor, Tensor]


class ReadingsLayer(nn.Module):
    """R readings to ``outputs`` numbers: weights W (R,outputs), a bias, and PyTorch's usual first values for both.

    The readings of a simulated trial are x = S r, with r its P pair resistances, and S is sparse: a reading against the
    sink is made of three of them. So W'x = (S'W)'r. The right side costs a tenth of the left one, and the readings,
    twenty-four times as many numbers, are never made.

    A third of the readings are copies of others by reciprocity, but for the sign. They have the same gradient, so Adam
    takes the same steps with their weights: W = ``fixed`` + ``sign`` * ``weight[copied]``, and only ``weight``, a row
    (D,outputs) for each reading that is no copy, is trained. Its gradient is that of W's row.
    """

    fixed: Tensor
    entered: Tensor
    sign: Tensor
    copied: Tensor

    def __init__(self, readings: int, outputs: int) -> None:
        super().__init__()
        usual = nn.Linear(readings, outputs)
        # A row for each reading: what S combines then lies together in memory.
        self.weight = nn.Parameter(usual.weight.detach().T.contiguous())
        self.bias = usual.bias
        self.register_buffer("fixed", torch.zeros(readings, outputs))
        self.register_buffer("sign", torch.ones(readings, 1))
        self.register_buffer("copied", torch.arange(readings))

    def readings_weight(self) -> Tensor:
        """W (R,outputs)."""
        return torch.addcmul(self.fixed, self.sign, self.weight[self.copied])

    def forward(self, readings: Tensor) -> Tensor:
        """(N,R) to (N,outputs)."""
        return torch.addmm(self.bias, readings, self.readings_weight())

    def set_combinations(self, matrix: Array) -> None:
        """``matrix`` (R,P): S, readings of pair resistances. Training needs it; the weights are kept without it."""
        first, copied, sign = distinct_rows(matrix)
        whole = self.readings_weight().detach()
        self.weight = nn.Parameter(whole[first])
        self.sign, self.copied = torch.from_numpy(sign).float()[:, None], torch.from_numpy(copied)
        self.fixed = whole - self.sign * self.weight.detach()[self.copied]
        self.register_buffer("entered", torch.from_numpy(matrix.T).float() @ self.fixed, persistent=False)
        count = np.bincount(copied, np.abs(sign), len(first))
        combined = matrix[first]
        for name, values in (("rows", csr_array(combined)), ("columns", csr_array((count[:, None] * combined).T))):
            bags = values.indices, values.indptr[:-1], values.data.astype(np.float32)
            for part, content in zip(("member", "start", "factor"), bags, strict=True):
                self.register_buffer(f"{name}_{part}", torch.from_numpy(content), persistent=False)

    def of_pairs(self, pairs: Tensor) -> Tensor:
        """(N,P) pair resistances to the (N,outputs) of their readings."""
        combined = _Combined.apply(self.weight, self._bags("columns"), self._bags("rows"))
        return torch.addmm(self.bias, pairs, combined + self.entered)

    def combined(self) -> Tensor:
        """(P,outputs) S'W, without a trace for autograd."""
        return _product(self._bags("columns"), self.weight) + self.entered

    def spread(self, gradient: Tensor) -> Tensor:
        """(D,outputs) gradient of ``weight`` from that of ``combined``."""
        return _product(self._bags("rows"), gradient)

    def _bags(self, name: str) -> Bags:
        member, start, factor = (getattr(self, f"{name}_{part}") for part in ("member", "start", "factor"))
        return member, start, factor

    def _load_from_state_dict(self, state_dict: dict[str, Tensor], prefix: str, *rest: Any) -> None:
        """How many readings are no copies is known to who trained the layer."""
        stored = state_dict.get(f"{prefix}weight")
        if stored is not None and len(stored) != len(self.weight):
            self.weight = nn.Parameter(torch.empty_like(stored))
        super()._load_from_state_dict(state_dict, prefix, *rest)


def distinct_rows(matrix: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Rows that are the same but for the sign, counted once.

    ``first`` (D,): a row of each kind. ``copied`` (R,): the number among them of every row; ``sign`` (R,): -1 or 1, and
    0 for a row of zeros, which is a copy of none.
    """
    largest = np.abs(matrix).argmax(axis=1)
    sign = np.sign(matrix[np.arange(len(matrix)), largest])
    upright = (sign[:, None] * matrix)[sign != 0]
    # Equal but for rounding: standardised readings differ in the last digits of their spread.
    rounded = np.round(upright / np.abs(matrix).max(), 9)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    copied = np.zeros(len(matrix), dtype=np.intp)
    copied[sign != 0] = inverse.ravel()
    first = np.flatnonzero(sign)[first]
    return first, copied, sign * sign[first][copied]


class _Combined(torch.autograd.Function):
    """S'W from the distinct rows of W (D,H), given S by columns and by rows; the gradient goes back by S."""

    @staticmethod
    def forward(context: Any, weight: Tensor, columns: Bags, rows: Bags) -> Tensor:
        """(P,H)."""
        context.rows = rows
        return _product(columns, weight)

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        """(D,H)."""
        return _product(context.rows, gradient), None, None


def _product(bags: Bags, dense: Tensor) -> Tensor:
    """A sparse matrix times a dense one: PyTorch's sum over bags of rows is the fastest it has for this."""
    member, start, factor = bags
    return embedding_bag(member, dense, start, mode="sum", per_sample_weights=factor)

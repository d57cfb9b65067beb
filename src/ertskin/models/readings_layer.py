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
    twenty-four times as many numbers, are never made. The weights and their gradients stay those of the readings.
    """

    def __init__(self, readings: int, outputs: int) -> None:
        super().__init__()
        usual = nn.Linear(readings, outputs)
        # A row for each reading: what S combines then lies together in memory.
        self.weight = nn.Parameter(usual.weight.detach().T.contiguous())
        self.bias = usual.bias

    def forward(self, readings: Tensor) -> Tensor:
        """(N,R) to (N,outputs)."""
        return torch.addmm(self.bias, readings, self.weight)

    def set_combinations(self, matrix: Array) -> None:
        """``matrix`` (R,P): S, readings of pair resistances. Training needs it; the weights are kept without it."""
        for name, values in (("rows", csr_array(matrix)), ("columns", csr_array(matrix.T))):
            bags = values.indices, values.indptr[:-1], values.data.astype(np.float32)
            for part, content in zip(("member", "start", "factor"), bags, strict=True):
                self.register_buffer(f"{name}_{part}", torch.from_numpy(content), persistent=False)

    def of_pairs(self, pairs: Tensor) -> Tensor:
        """(N,P) pair resistances to the (N,outputs) of their readings."""
        return torch.addmm(self.bias, pairs, _Combined.apply(self.weight, self._bags("columns"), self._bags("rows")))

    def _bags(self, name: str) -> Bags:
        member, start, factor = (getattr(self, f"{name}_{part}") for part in ("member", "start", "factor"))
        return member, start, factor


class _Combined(torch.autograd.Function):
    """S'W from W (R,H), given S by columns and by rows; the gradient goes back by S."""

    @staticmethod
    def forward(context: Any, weight: Tensor, columns: Bags, rows: Bags) -> Tensor:
        """(P,H)."""
        context.rows = rows
        return _product(columns, weight)

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        """(R,H)."""
        return _product(context.rows, gradient), None, None


def _product(bags: Bags, dense: Tensor) -> Tensor:
    """A sparse matrix times a dense one: PyTorch's sum over bags of rows is the fastest it has for this."""
    member, start, factor = bags
    return embedding_bag(member, dense, start, mode="sum", per_sample_weights=factor)

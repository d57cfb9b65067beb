"""Batch normalisation for small networks."""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn.functional import batch_norm


class BatchNorm(nn.BatchNorm1d):
    """``nn.BatchNorm1d`` bit for bit, but for the count of batches, which only an average without momentum needs.

    Counting them costs as much as normalising a small batch.
    """

    def forward(self, values: Tensor) -> Tensor:
        """(N,features) to the same shape."""
        mean, var, momentum = self.running_mean, self.running_var, self.momentum
        assert momentum is not None
        return batch_norm(values, mean, var, self.weight, self.bias, self.training, momentum, self.eps)

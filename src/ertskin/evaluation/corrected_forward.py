"""The forward model with what the training recording showed beyond it: what the networks learned from."""

from __future__ import annotations

from ertskin.data.discrepancy import Discrepancy
from ertskin.data.synthesis import Forward
from ertskin.evaluation.outcome import Array
from ertskin.physics.protocol import Protocol


class CorrectedForward:
    """``forward`` plus ``discrepancy``; the oracle on a real recording, where nobody has the true physics."""

    def __init__(self, forward: Forward, discrepancy: Discrepancy, protocol: Protocol) -> None:
        self.forward, self.discrepancy, self.protocol = forward, discrepancy, protocol

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C)."""
        beyond_v = self.discrepancy.of(contact_m, force_n)
        return self.forward.change_ohm(contact_m, force_n) + self.protocol.unwhitened(beyond_v)

"""How much a diagnosis has computed, counted alike on every machine: what ends a search that would go on and on."""

from __future__ import annotations

from dataclasses import dataclass

MOST = 3e9
"""Derivatives of one whitened number of one scan by one unknown each, after which a search begins nothing new: five to
eight minutes of CPU (1.0e-7 to 1.5e-7 s each, all other work with it: c129, c159 and c038 of ``final310``)."""


@dataclass(eq=False)
class Work:
    """Derivatives computed so far, by all fits to one recording; ``has_ended``: whether a search was cut short."""

    done: float = 0.0
    has_ended: bool = False

    def add(self, derivatives: int) -> None:
        """Count so many derivatives more."""
        self.done += derivatives

    def ends(self) -> bool:
        """Whether what would begin now is not to; that it was asked for is remembered."""
        self.has_ended = self.has_ended or self.done >= MOST
        return self.has_ended

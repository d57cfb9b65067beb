"""How much a diagnosis has computed, counted instead of timed: what ends a search that would go on and on."""

from __future__ import annotations

from dataclasses import dataclass

MOST = 3e9
"""Derivatives of one number of one scan by one unknown each, after which a search takes up nothing more. Three
recordings took 2.4e9 in 265 s of CPU, 2.25e9 in 342 s and 4.5e9 in 464 s, all other work with it (c159, c038, c129 of
``final310``)."""


@dataclass(eq=False)
class Work:
    """Derivatives computed so far, by all fits to one recording; ``has_ended``: whether a search was cut short."""

    done: float = 0.0
    has_ended: bool = False

    def add(self, derivatives: int) -> None:
        """Count so many derivatives more."""
        self.done += derivatives

    def ends(self) -> bool:
        """Whether what would be taken up next is not to be; that it was asked for is remembered."""
        self.has_ended = self.has_ended or self.done >= MOST
        return self.has_ended

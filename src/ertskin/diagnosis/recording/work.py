"""How much a diagnosis has computed, counted instead of timed: what ends a search that would go on and on."""

from __future__ import annotations

from dataclasses import dataclass

MOST = 4e9
"""Derivatives of one number each, of a scan or of what no network explains, after which a search takes up nothing more:
of fits by one unknown (of scans of a skin that moves meanwhile at each of the moments looked at), of states linearised
about by a node, a contact or a pad's shift. Some 1e7 take a second of CPU."""


@dataclass(eq=False)
class Work:
    """Derivatives computed so far, for one recording; ``has_ended``: whether a search was cut short."""

    done: float = 0.0
    has_ended: bool = False

    def add(self, derivatives: int) -> None:
        """Count so many derivatives more."""
        self.done += derivatives

    def ends(self) -> bool:
        """Whether what would be taken up next is not to be; that it was asked for is remembered."""
        self.has_ended = self.has_ended or self.done >= MOST
        return self.has_ended

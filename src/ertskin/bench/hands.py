"""What a stage can't do at a bench: lay weights on, change the wiring. Somebody is asked to, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ertskin.errors import JobFailed

if TYPE_CHECKING:
    from rich.console import Console

    from ertskin.hardware.plan import Press


class Hands(Protocol):
    """Somebody at the bench."""

    def place_weights(self, press: Press | None) -> None:
        """Lay a press's weights on, or with None take them off; returns when done."""
        ...

    def wire_specimen(self, wired: bool) -> None:
        """Wire the reader to the specimen, or back to the skin; returns when done."""
        ...


class Person:
    """Whoever sits at the terminal."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def place_weights(self, press: Press | None) -> None:
        """Ask, and wait for Enter."""
        if press is None:
            self._ask("take the weights off")
            return
        places = " and ".join(f"({1e3 * x:.1f}, {1e3 * y:.1f}) mm" for x, y in press.contact_m)
        self._ask(f"lay a weight of {press.weight_n:.2f} N on {places}")

    def wire_specimen(self, wired: bool) -> None:
        """Ask, and wait for Enter."""
        self._ask(f"wire the reader to the {'specimen' if wired else 'skin'}")

    def _ask(self, what: str) -> None:
        try:
            self._console.input(f"{what}, then Enter ")
        except EOFError:
            raise JobFailed(f"nobody there to {what}") from None

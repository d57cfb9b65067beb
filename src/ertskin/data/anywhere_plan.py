"""Which contacts to draw for networks that are touched anywhere, and what their regions allow for."""

from __future__ import annotations

from dataclasses import dataclass

from ertskin.settings import limited


@dataclass(frozen=True)
class AnywherePlan:
    """``trials`` of one to ``contacts`` contacts anywhere on the sheet, each number equally often.

    Forces up to ``max_force_n``, 0: to a little above the recording's largest; none below ``min_force_n``.
    """

    trials: int = limited(40_000, least=10)
    contacts: int = limited(4, least=1)
    min_force_n: float = limited(0.2, above=0)
    max_force_n: float = limited(0.0, least=0)
    seed: int = limited(0, least=0)


@dataclass(frozen=True)
class Stated:
    """What stated regions allow for beyond what the recording's presses tell.

    ``load_cell_error``: one sigma of the load cell's scale, as a share of the force. 0.5 % is what makers of hand-held
    force gauges state, of their whole range; every press was read by the same cell, so that no press tells.
    """

    load_cell_error: float = limited(0.005, least=0, most=0.5)

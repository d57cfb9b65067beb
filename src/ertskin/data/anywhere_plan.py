"""Which contacts to draw for networks that are touched anywhere."""

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

"""Forms of one effect: what tells them apart, and which are freer than the one at hand."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from ertskin.diagnosis.fit.terms import Term
from ertskin.physics.effects.field_over_sheet import FieldOverSheet


def form_of(term: Term) -> tuple[object, ...]:
    """What tells one form of an effect from another: what is free, its law, whether it is a smooth field."""
    return term.free, *law_of(term), term.modes is not None


def law_of(term: Term) -> tuple[bool, ...]:
    """The laws that an effect may obey."""
    flags = "remembers_air", "multiplies", "ages", "by_steps", "evenly", "percolates"
    return tuple(bool(getattr(term.effect, flag, False)) for flag in flags)


def freer(term: Term) -> list[Term]:
    """The term with more of its form free, or in its other form; none where there is no more to free."""
    return [replace(term, effect=start.effect, free=start.free) for start in term.effect.freer(term.free)]


def beginnings(field: Term) -> list[Term]:
    """The ways in which a field over the sheet that is new to a fit may begin."""
    starts = cast(FieldOverSheet, field.effect).beginnings(field.free)
    return [replace(field, effect=start.effect, free=start.free) for start in starts]

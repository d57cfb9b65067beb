"""Which forms of creep a fit may come to from which."""

from __future__ import annotations

import pytest

from ertskin.physics.effects.effect import Start
from ertskin.physics.effects.piezo_creep import PiezoCreep


def reached(start: Start) -> list[Start]:
    """All that freeing a start may come to."""
    found = [start]
    for one in found:
        found += [form for form in one.effect.freer(one.free) if form not in found]
    return found


@pytest.mark.parametrize("start", PiezoCreep.specimen_starts(), ids=str)
def test_contacts_that_age_are_asked_from_every_start(start: Start) -> None:
    """A skin whose contacts age was left at 1.9 of the noise in powers of the pressure, at 1.2 by their age."""
    forms = [form.effect for form in reached(start)]
    assert any(form.ages for form in forms if isinstance(form, PiezoCreep))


def test_no_form_frees_for_ever() -> None:
    assert all(len(reached(start)) < 10 for start in PiezoCreep.specimen_starts())

"""Which forms of creep a fit may come to from which."""

from __future__ import annotations

import pytest

from ertskin.physics.effects.effect import Start
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis


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


@pytest.mark.parametrize(
    ("effect", "shape"),
    [
        (PiezoCreep(0.1, 3.0), ("time_s",)),
        (PiezoCreep(0.1, 3.0, decades=2.0, exponent=0.8), ("time_s", "decades", "exponent")),
        (PiezoCreep(0.1, 3.0, decades=2.0, multiplies=True), ("time_s", "decades", "half_pa")),
        (
            PiezoCreep(0.1, 3.0, decades=2.0, multiplies=True, unevenness=1.0, power=0.5),
            ("time_s", "decades", "half_pa", "unevenness", "power"),
        ),
        (PiezoCreep(0.1, 3.0, multiplies=True, ages=True), ("time_s", "half_pa", "slip")),
    ],
    ids=["one time constant", "powers of the pressure", "gaps that close", "uneven gaps", "contacts that age"],
)
def test_creep_of_a_known_shape_may_first_have_that_free(effect: PiezoCreep, shape: tuple[str, ...]) -> None:
    whole, *freer = effect.freer(("fraction",))
    assert whole == Start(effect, ("fraction", *shape))
    assert tuple(freer) == effect.freer(("fraction", *shape))


def test_a_loop_of_a_known_shape_may_have_that_free() -> None:
    assert PiezoHysteresis(lag=0.2, way_pa=2e3).freer(("lag",))[0].free == ("lag", "way_pa")
    (freed,) = PiezoHysteresis(width=0.2, spread=0.7).freer(("width",))
    assert freed == Start(PiezoHysteresis(width=0.2, spread=0.7), ("width", "spread"))


def test_the_law_without_any_lag_is_free_in_all_that_its_form_has() -> None:
    creep = PiezoCreep(0.1, 3.0, decades=2.0, multiplies=True, unevenness=1.0)
    static = creep.at_once(("fraction",))
    assert static is not None
    assert static.free == ("fraction", "half_pa", "unevenness", "power")


def test_without_any_lag_the_age_of_contacts_is_how_many_there_are() -> None:
    static = PiezoCreep(0.1, 3.0, half_pa=2e4, slip=0.3, multiplies=True, ages=True).at_once(("fraction", "time_s"))
    assert static is not None
    assert static.effect == PiezoCreep(0.1, 0.05, half_pa=2e4, multiplies=True)
    assert static.free == ("fraction", "half_pa")

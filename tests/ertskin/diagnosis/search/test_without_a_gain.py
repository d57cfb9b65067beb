"""A gain that another form of crosstalk does is superfluous; one that nothing else does is not."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_problem import CHANNELS, PARTITIONS, START, recorded

from ertskin.diagnosis.contract.claims import Rival
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.search.backward import backward
from ertskin.diagnosis.search.chosen import carried, key_of
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.crosstalk import Crosstalk
from ertskin.physics.effects.effect import Effect

SHARES = tuple(4e-3 * share for share in (5.0, 1.8, 0.2, 1.0, 1.5, 0.6))
EMPTY = Crosstalk(shares=SHARES, begins="discharged")
EACH = tuple(f"shares[{k}]" for k in range(CHANNELS))


@pytest.mark.parametrize(
    ("true", "left"),
    [((EMPTY,), ["crosstalk"]), ((EMPTY, ChannelGain(2, gain=0.02)), ["channel_gain", "crosstalk"])],
)
def test_an_empty_capacitor_is_no_gain(true: tuple[Effect, ...], left: list[str]) -> None:
    problem = recorded(*true)
    gain = Term(ChannelGain(0 if len(true) == 1 else 2, gain=-0.01), ("gain", "offset_v"))
    settled = Term(replace(EMPTY, begins="settled"), EACH)
    current = problem.solve([gain, settled], START, leftover=True)
    _, found = backward(problem, current, 0, PARTITIONS, {})
    assert [term.name for term in found.terms] == left
    crosstalk = next(one for one in found.effects if isinstance(one, Crosstalk))
    if left == ["crosstalk"]:
        assert crosstalk.begins == "discharged"


def test_a_form_that_is_freed_keeps_its_rivals() -> None:
    alone = Term(Crosstalk(fraction=0.01, channel=2, shares=(0.0,) * CHANNELS), ("fraction",))
    each = next(Term(form.effect, form.free) for form in alone.effect.freer(alone.free) if "shares[0]" in form.free)
    assert key_of(alone) != key_of(each)
    stand = {key_of(alone): (Rival(ChannelGain(2), 3.0),)}
    carried(stand, [alone], [each])
    assert stand[key_of(each)] == stand[key_of(alone)]

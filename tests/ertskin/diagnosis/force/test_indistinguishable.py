"""Loss and softening differ in a second way in; where there is none, no fit may prefer one of them."""

from __future__ import annotations

import numpy as np
import pytest

from ertskin.diagnosis.force.claims import distinguishable
from ertskin.physics.effects.foam_hysteresis import FoamHysteresis
from ertskin.physics.effects.foam_softening import FoamSoftening
from ertskin.physics.effects.viscoelastic_foam import ViscoelasticFoam
from ertskin.physics.history import History, Phase

IN, OUT, REST = Phase.LOADING, Phase.UNLOADING, Phase.REST


def presses(*courses: tuple[float, list[Phase]]) -> History:
    """Presses at places along x, each with the phases of its frames."""
    x = np.concatenate([np.full(len(phases), place) for place, phases in courses])
    phase = np.concatenate([np.array(phases, dtype=np.uint8) for _, phases in courses])
    press = np.repeat(np.arange(len(courses)), [len(phases) for _, phases in courses])
    contact = np.stack([x, np.zeros_like(x)], axis=1)[:, None]
    touched = (phase != REST)[:, None]
    force = np.where(touched, 1.0, np.nan)
    return History(
        time_s=np.arange(len(x), dtype=float),
        contact_m=np.where(touched[..., None], contact, np.nan),
        force_n=force,
        depth_m=1e-3 * force,
        phase=phase,
        press=press,
    )


@pytest.mark.parametrize(
    ("history", "expected"),
    [
        (presses((0.01, [REST, IN, IN, OUT]), (0.03, [REST, IN, OUT])), False),
        (presses((0.01, [REST, IN, OUT]), (0.03, [REST, IN, OUT]), (0.01, [REST, IN, OUT])), True),
        (presses((0.01, [REST, IN, OUT, IN, OUT]), (0.03, [REST, IN, OUT])), True),
    ],
    ids=["each place once", "one place twice", "in again within a press"],
)
def test_only_a_second_way_in_tells(history: History, expected: bool) -> None:
    assert distinguishable(FoamHysteresis(), FoamSoftening(), history) is expected
    assert distinguishable(FoamHysteresis(), ViscoelasticFoam(), history)

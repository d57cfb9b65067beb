"""What a frame at rest loses without a term, beside what any frame loses."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.joint_fit import Term
from ertskin.diagnosis.judge.answer import _shown_at_rest
from ertskin.diagnosis.search.selection import Chosen, _lost_at_rest
from ertskin.physics.effects.contact_pressure_dependence import ContactPressureDependence
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.electrode_displacement import ElectrodeDisplacement
from ertskin.physics.effects.piezo_creep import PiezoCreep
from ertskin.physics.effects.scan_skew import ScanSkew
from ertskin.physics.effects.temperature_drift import TemperatureDrift

REST = np.array([True, True, False, False, False, False])
WEIGHT = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])


def problem(rest: np.ndarray = REST) -> Any:
    """All that is asked of a problem: frames at rest, and frames fitted."""
    return SimpleNamespace(evidence=SimpleNamespace(rest=rest), weight=WEIGHT)


def fit(*size: float) -> Any:
    """A fit that misses each of its four numbers in a frame by this much."""
    return SimpleNamespace(scan_residual=np.repeat(np.array(size)[:, None], 4, axis=1))


def test_what_stays_as_it_is_costs_frames_at_rest_as_much_as_others() -> None:
    found = _lost_at_rest(problem(), fit(2.0, 2.0, 2.0, 2.0, 2.0, 9.0), fit(1.0, 1.0, 1.0, 1.0, 1.0, 1.0))
    assert found == pytest.approx(1.0)


def test_what_needs_a_press_costs_frames_at_rest_nothing() -> None:
    assert _lost_at_rest(problem(), fit(1.0, 1.0, 2.0, 2.0, 2.0, 9.0), fit(*[1.0] * 6)) == 0.0


def test_what_no_frame_loses_is_not_shown_at_rest() -> None:
    assert _lost_at_rest(problem(), fit(2.0, 2.0, 0.5, 0.5, 0.5, 9.0), fit(1.0, 1.0, 2.0, 2.0, 2.0, 1.0)) == 0.0


def test_one_of_two_of_a_name_that_rest_frames_do_not_show_speaks_for_neither() -> None:
    pads = [Term(ElectrodeDisplacement(along_m=3e-4, electrode=k), ()) for k in (1, 2)]
    chosen = tuple(Chosen(pad, 1e3, 1.3, (), at_rest=share) for pad, share in zip(pads, (0.9, 0.1), strict=True))
    selection: Any = SimpleNamespace(chosen=chosen)
    assert _shown_at_rest(selection, DEFAULT) == set()


def test_without_frames_at_rest_nothing_is_shown_there() -> None:
    assert _lost_at_rest(problem(~np.ones(6, dtype=bool)), fit(*[2.0] * 6), fit(*[1.0] * 6)) == 0.0


@pytest.mark.parametrize(
    ("effect", "at_rest", "shown"),
    [
        (ElectrodeDisplacement(along_m=3e-4), 0.9, True),
        (ElectrodeDisplacement(along_m=3e-4), 0.1, False),
        # What drifts may be places that have not recovered.
        (TemperatureDrift(), 0.9, False),
        (PiezoCreep(fraction=0.1), 0.9, False),
        (ScanSkew(speed_m_per_s=1e-4), 0.9, False),
        # Rest frames may lose by a calibration that makes up for what a press needs.
        (ContactPressureDependence(sensitivity_per_pa=1e-4), 0.9, False),
    ],
)
def test_only_what_stays_as_it_is_is_shown_at_rest(effect: Effect, at_rest: float, shown: bool) -> None:
    selection: Any = SimpleNamespace(chosen=(Chosen(Term(effect, ()), 1e3, 1.3, (), at_rest=at_rest),))
    assert _shown_at_rest(selection, DEFAULT) == ({effect.name} if shown else set())

"""Paths of contacts stay where nothing else does what they do at rest, however little that is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.search import selection
from ertskin.diagnosis.search.contact_paths import (
    as_good_at_rest,
    changed_by_paths,
    without_paths,
    without_paths_of_drifting_channels,
)
from ertskin.physics.effects.adc_saturation import AdcSaturation
from ertskin.physics.effects.channel_gain import ChannelGain
from ertskin.physics.effects.contact_drift import ContactDrift
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.sheet_anisotropy import SheetAnisotropy
from ertskin.physics.protocol import Protocol, electrode_pairs

FRAMES, PAIRS = 20, 400
TIME_S = np.arange(FRAMES, dtype=float)
RISING = ContactDrift(3, tuple(TIME_S.tolist()), tuple(TIME_S.tolist()))
EVEN = SheetAnisotropy()


@dataclass(frozen=True, eq=False)
class Fitted:
    scan_residual: NDArray[np.float64]
    terms: tuple[Any, ...] = (SimpleNamespace(effect=EVEN), SimpleNamespace(effect=RISING))
    calibration: None = None

    @property
    def effects(self) -> tuple[Effect, ...]:
        return tuple(term.effect for term in self.terms)


def fit(path_per_frame: float, left: float, missed: float = 0.0) -> Any:
    """A fit, every second frame at rest, with a path that does ``path_per_frame`` in each of ten pairs and frame, and
    leaves noise of ``left`` and a share ``missed`` of what the path does."""
    noise = left * np.random.default_rng(0).standard_normal((FRAMES, PAIRS))
    rising = np.zeros((FRAMES, PAIRS))
    rising[:, :10] = path_per_frame * (TIME_S - TIME_S[::2].mean())[:, None]
    frames = SimpleNamespace(discounted=lambda scans: scans)
    problem = SimpleNamespace(
        scan_residual=lambda effects: noise + (missed if RISING in effects else 1.0) * rising,
        in_full=lambda fit, rows: rising[rows] * (RISING in fit.effects),
        family=SimpleNamespace(skin=lambda calibration, effects: effects),
        evidence=SimpleNamespace(
            criteria=DEFAULT, rest=np.arange(FRAMES) % 2 == 0, noise_v=1.0, frames=lambda rows: frames
        ),
        weight=np.ones(FRAMES),
    )
    return SimpleNamespace(problem=problem, solved=Fitted(noise + missed * rising))


def test_what_a_path_changes_is_what_the_scans_lack_without_it() -> None:
    one = fit(0.1, 1.0)
    ((path, changed),) = changed_by_paths(one.problem, one.solved)
    assert path is RISING
    assert changed[:, 0] == pytest.approx(0.1 * (TIME_S - 9.0))
    assert changed[:, 10:] == pytest.approx(0.0)
    without = replace(one.solved, terms=one.solved.terms[:1])
    assert changed_by_paths(one.problem, without) == []


def test_terms_without_paths() -> None:
    path, other = SimpleNamespace(effect=RISING), SimpleNamespace(effect=EVEN)
    assert without_paths([path, other]) == [other]  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("effect", "stay"), [(ChannelGain(3), False), (ChannelGain(2), True), (AdcSaturation(), True), (EVEN, True)]
)
def test_a_path_may_be_owed_to_the_channel_that_reads_its_electrode(effect: Effect, stay: bool) -> None:
    path, other = SimpleNamespace(effect=RISING), SimpleNamespace(effect=effect)
    terms: list[Any] = [path, other]
    against_sink = Protocol.against_sink(electrode_pairs(8), 8, 1e-4)
    assert without_paths_of_drifting_channels(terms, against_sink) == ([path, other] if stay else [other])


@pytest.mark.parametrize(("channel", "stay"), [(1, True), (2, False), (3, False), (4, True)])
def test_a_channel_between_two_electrodes_may_be_either_s(channel: int, stay: bool) -> None:
    rows = np.roll(np.eye(8), 1, axis=1) - np.eye(8)
    protocol: Any = SimpleNamespace(measurement=np.repeat(rows[None], 5, axis=0))
    terms: list[Any] = [SimpleNamespace(effect=RISING), SimpleNamespace(effect=ChannelGain(channel))]
    assert without_paths_of_drifting_channels(terms, protocol) == (terms if stay else terms[1:])


def test_a_path_that_nothing_stands_in_for_stays_though_it_changes_hardly_anything() -> None:
    beside = fit(0.12, 1.0)
    missed = fit(0.12, 1.0, 1.0)
    ratio = np.sqrt((missed.solved.scan_residual[::2] ** 2).mean() / (beside.solved.scan_residual[::2] ** 2).mean())
    assert ratio < DEFAULT.chance_ratio
    assert not as_good_at_rest(missed, beside)


def test_a_path_goes_where_something_else_does_most_of_what_it_does() -> None:
    beside = fit(0.12, 1.0)
    assert as_good_at_rest(fit(0.12, 1.0, 0.3), beside)
    assert as_good_at_rest(fit(0.12, 1.0), beside)


def test_what_little_comes_by_chance_is_not_missed() -> None:
    assert as_good_at_rest(fit(0.05, 1.0, 1.0), fit(0.05, 1.0))
    assert as_good_at_rest(fit(0.12, 5.0, 1.0), fit(0.12, 5.0))


def test_a_material_rise_is_missed_whoever_made_it() -> None:
    assert not as_good_at_rest(fit(0.12, 1.05), fit(0.12, 1.0))


def test_fixed_terms_stay_but_for_the_path_whose_channel_drifts_however_they_are_fitted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before: list[Any] = [SimpleNamespace(effect=EVEN, name="even"), SimpleNamespace(effect=RISING, name="path")]
    fitted: list[Any] = [*(SimpleNamespace(**vars(one)) for one in before), SimpleNamespace(effect=ChannelGain(3))]
    solved = SimpleNamespace(terms=tuple(fitted), effects=(), calibration=None)
    problem = SimpleNamespace(
        solve=lambda terms, calibration: SimpleNamespace(terms=tuple(terms), effects=()),
        evidence=SimpleNamespace(protocol=Protocol.against_sink(electrode_pairs(8), 8, 1e-4)),
    )
    incumbent: Any = SimpleNamespace(problem=problem, solved=solved)
    settled: list[Any] = []

    def where_it_settles(build: object, problem: object, solved: Any) -> Any:
        settled.append(solved)
        return SimpleNamespace(solved=solved, spoils=lambda other: False)

    monkeypatch.setattr(selection, "where_it_settles", where_it_settles)
    for as_good in (True, False):
        monkeypatch.setattr(selection, "as_good_at_rest", lambda without, present, good=as_good: good)
        found, fixed = selection._without_drifts(None, incumbent, before)  # type: ignore[arg-type]
        assert fixed == (before[:1] if as_good else before)
        assert found.solved.terms == ((fitted[0], fitted[2]) if as_good else solved.terms)
    assert len(settled) == 2

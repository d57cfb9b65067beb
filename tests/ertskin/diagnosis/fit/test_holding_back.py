"""What only few presses tell can't run off, and what fits worse when solved in full doesn't enter."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ertskin.diagnosis.contract.claims import FORM, estimate
from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.fit.bounded_step import Region
from ertskin.diagnosis.fit.cells_held_out import _numbers, held_out
from ertskin.diagnosis.fit.full_solution_check import CheckedFit
from ertskin.diagnosis.fit.levenberg_marquardt import Fit
from ertskin.diagnosis.fit.quadratic import Quadratic
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.recording.work import MOST, Work
from ertskin.diagnosis.search import entering, selection, settling, trials
from ertskin.diagnosis.search.candidates import Candidate
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.crosstalk import Crosstalk
from ertskin.physics.effects.hypothesis import Signal
from ertskin.physics.effects.indenter_offset import IndenterOffset
from ertskin.physics.effects.piezo_hysteresis import PiezoHysteresis
from ertskin.physics.effects.piezo_inhomogeneity import PiezoInhomogeneity

PROBLEM: Any = SimpleNamespace(evidence=SimpleNamespace(criteria=DEFAULT, seen_at_rest=None, work=Work()))
"""All that is asked of the problem of a fit that has settled."""


def fitted(slopes: list[float], pulls: list[float]) -> Solved:
    """A term's one number, at its best: how steeply and in which direction each cell pulls at it."""
    slope, pull = np.array(slopes), np.array(pulls)
    cost = 0.5 + 0.5 * pull**2
    gradient, hessian = (slope * pull)[:, None], (slope**2)[:, None, None]
    fit = Fit(np.array([0.1]), Quadratic(cost, gradient, hessian), np.zeros((1, 1)), 1)
    return Solved(None, (Term(PiezoHysteresis(width=0.1), ("width",)),), fit, np.zeros((1, 1)))  # type: ignore[arg-type]


def test_a_cell_that_others_tell_about_is_predicted_by_a_whole_newton_step() -> None:
    found = held_out(fitted([1e4, 1e4, 1e4], [1.0, -2.0, 1.0]), [[0], [1], [2]])
    # The mean of the others' pulls is where they would put the number.
    assert found == pytest.approx([0.5 + 0.5 * 1.5**2, 0.5 + 0.5 * 3.0**2, 0.5 + 0.5 * 1.5**2])


def test_a_number_at_its_bound_is_not_predicted_beyond_it() -> None:
    """Creep at its largest share was predicted with more of it than any fit may have: 57000 where 41000 were left."""
    free = fitted([1e4, 1e4, 1e4], [1.0, 1.0, -2.0])
    at_bound = replace(free, fit=replace(free.fit, region=Region(np.array([0.0]), np.array([0.1]))))
    # Without the last cell the others would step up, and it would be missed by as much more.
    assert held_out(free, [[2]]) == pytest.approx([0.5 + 0.5 * 3.0**2])
    assert held_out(at_bound, [[2]]) == pytest.approx([0.5 + 0.5 * 2.0**2])
    assert held_out(at_bound, [[0]]) == pytest.approx(held_out(free, [[0]]))


def test_a_term_at_its_bound_that_only_one_cell_tells_is_away_in_what_the_others_predict_there() -> None:
    """The others' noise may pull it outwards: the bound keeps it, and says nothing of it."""
    free = fitted([1e3, 1e-3, 1e-3], [1.0, 10.0, 0.0])
    at_bound = replace(free, fit=replace(free.fit, region=Region(np.array([0.0]), np.array([0.1]))))
    assert held_out(at_bound, [[0]])[0] == pytest.approx(0.5 + 0.5 * (1.0 + 1e3 * 0.1) ** 2, rel=0.01)


def test_a_term_that_only_one_cell_tells_is_away_in_what_the_others_predict_there() -> None:
    found = held_out(fitted([1e3, 1e-3, 1e-3], [1.0, -1e6, 0.0]), [[0]])
    # The loop's width is 0.1, and the cell pulls by 1 where it is.
    assert found[0] == pytest.approx(0.5 + 0.5 * (1.0 + 1e3 * 0.1) ** 2)


def test_a_term_that_others_half_tell_is_as_far_away_as_they_leave_it() -> None:
    # The other cell would step by 1.5, or by 0.2: beyond 0.15. With a prior of that width towards absence:
    found = held_out(fitted([1e3, 20.0], [1.0, 20.0 * 1.5]), [[0]])
    reach = 5.0 * PiezoHysteresis.parameters()["width"].typical
    step = (20.0 * 30.0 - 0.1 / reach**2) / (20.0**2 + 1 / reach**2)
    assert step > reach
    assert found[0] == pytest.approx(0.5 + 0.5 * (1.0 + 1e3 * 0.1) ** 2)
    found = held_out(fitted([1e3, 5.0], [1.0, 5.0 * 0.2]), [[0]])
    step = (5.0 * 1.0 - 0.1 / reach**2) / (5.0**2 + 1 / reach**2)
    assert -0.1 < step < 0.2
    assert found[0] == pytest.approx(0.5 + 0.5 * (1.0 - 1e3 * step) ** 2)


def searching(monkeypatch: pytest.MonkeyPatch, found: list[Any], beyond: list[Any]) -> tuple[Any, Any, list[str]]:
    """A search whose trials are those ``found``, a fit to begin with, and what it then settles, none of which holds."""
    settled: list[str] = []

    def settle(build: Any, solved: Any) -> CheckedFit:
        settled.append(solved)
        return CheckedFit(PROBLEM, None, 9.0, 0.0)  # type: ignore[arg-type]

    monkeypatch.setattr(settling, "settled", settle)
    monkeypatch.setattr(selection, "screen", lambda *given: [])
    monkeypatch.setattr(selection, "form_error", lambda *given: SimpleNamespace(gain=0.0))
    monkeypatch.setattr(selection, "worth_a_name", lambda *given: 1.0)
    monkeypatch.setattr(selection, "worthy", lambda problem, current, fitted, asked: list(fitted))
    monkeypatch.setattr(selection, "instrument_worth_a_name", lambda *given: None)
    monkeypatch.setattr(selection, "trials_of", lambda *given: [list(found), list(beyond)])
    monkeypatch.setattr(selection, "_as_tried", lambda one, kept: one.solved)
    monkeypatch.setattr(selection, "exchanged", lambda *given: None)
    monkeypatch.setattr(selection, "with_field_by_place", lambda *given: None)
    problem: Any = SimpleNamespace(evidence=PROBLEM.evidence, at_hand=lambda solved: solved)
    search = selection._Search(lambda solved: problem, [[0]], lambda share, text: None, 0, {})
    return search, CheckedFit(problem, SimpleNamespace(effects=(), terms=()), 3.0, 0.0), settled  # type: ignore[arg-type]


def test_what_did_not_hold_where_it_settles_is_not_settled_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    search, fit, settled = searching(monkeypatch, [trial("wild", "one", 50.0)], [trial("far", "other", 40.0)])
    assert search.one_more(fit) is None
    assert settled == ["wild", "far"]
    assert search.tried == ["wild", "far"]


@pytest.mark.parametrize(("gain", "expected"), [(20.0, []), (30.0, ["wild", "far"])])
def test_nothing_is_settled_where_nothing_likely_is_wanted(
    gain: float, expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [trial("wild", "one", 50.0), trial("far", "other", gain)]
    search, fit, settled = searching(monkeypatch, found, [])
    assert search.one_more(fit, lambda one: one.solved == "far") is None
    assert settled == expected
    assert search.tried == ["wild", "far"]


def test_what_earlier_lists_left_unsaid_counts_for_later_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[Any]] = []

    def worthy(problem: Any, current: Any, fitted: Any, trials: Any) -> list[Any]:
        asked.append([one.solved for one in trials])
        return []

    search, fit, _ = searching(monkeypatch, [trial("wild", "one", 50.0)], [trial("far", "other", 40.0)])
    monkeypatch.setattr(selection, "worthy", worthy)
    assert search.one_more(fit) is None
    assert asked == [["wild"], ["wild", "far"]]


@pytest.mark.parametrize("of_instrument", [True, False], ids=["of an instrument", "of none"])
@pytest.mark.parametrize(("gain", "enters"), [(24.0, False), (26.0, True)])
def test_beside_an_instrument_that_does_not_hold_less_likely_names_and_places_rest(
    of_instrument: bool, gain: float, enters: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, later = trial("wild", "crosstalk", 50.0), trial("far", "other", 20.0)
    search, fit, settled = searching(monkeypatch, [found], [later])
    by_place = CheckedFit(fit.problem, fit.solved, 2.0, 0.0)
    monkeypatch.setattr(selection, "instrument_worth_a_name", lambda *given: found if of_instrument else None)
    monkeypatch.setattr(selection, "with_field_by_place", lambda build, incumbent: (by_place, gain))
    monkeypatch.setattr(selection._Search, "_refined", lambda search, fit, *free: fit)
    assert search.one_more(fit) is (by_place if enters or not of_instrument else None)
    assert settled == (["wild"] if of_instrument else ["wild", "far"])
    # What nobody wants is left at that, whatever the instrument gains.
    settled.clear()
    assert search.one_more(fit, lambda one: one.solved == "wild") is None
    assert settled == ["wild"]


def test_nothing_is_predicted_better_than_it_is_fitted() -> None:
    # Pulls that do not cancel: the fit has not come to rest, and a step would take all of them away.
    solved = fitted([10.0, 10.0], [0.5, 0.5])
    assert held_out(solved, [[0], [1]]) == pytest.approx(solved.fit.quadratic.cost)


def test_one_of_several_of_a_kind_that_others_do_not_tell_is_away_alone() -> None:
    keys = ("shares[0]", "shares[1]", "lasting")
    solved = replace(fitted([1.0], [0.0]), terms=(Term(Crosstalk(shares=(0.1, 0.2), lasting=0.3), keys),))
    solved = replace(solved, fit=replace(solved.fit, value=np.array([0.1, 0.2, 0.3])))
    alone = [(one.index.tolist(), one.away.tolist()) for one in _numbers(solved)]
    assert alone == [([2], [0.0]), ([0], [-0.1]), ([1], [-0.2])]


def test_a_term_that_one_cell_alone_wants_gains_nothing_held_out() -> None:
    found = held_out(fitted([30.0, 1.0, 1.0], [1.0, -15.0, -15.0]), [[0], [1], [2]])
    without = 0.5 + 0.5 * (1.0 + 30.0 * 0.1) ** 2
    assert found[0] >= without


def test_a_term_that_spoils_frames_solved_in_full_gives_way_to_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    incumbent, wild, tame = (CheckedFit(PROBLEM, None, misfit, 0.0) for misfit in (3.0, 9.0, 2.0))  # type: ignore[arg-type]
    settle = {"wild": wild, "tame": tame}
    monkeypatch.setattr(settling, "settled", lambda build, solved: settle[solved])
    trials = [trial("wild", "one", 50.0), trial("tame", "other", 40.0)]
    found = entering.first_to_hold(None, incumbent, trials, [])  # type: ignore[arg-type]
    assert found is not None
    assert (found[0].solved, found[1]) == ("tame", tame)
    assert entering.first_to_hold(None, incumbent, trials[:1], []) is None  # type: ignore[arg-type]


def trial(solved: str, name: str, gain: float, modes: Any = None, signals: tuple[Signal, ...] = ()) -> trials.Trial:
    term = SimpleNamespace(name=name, modes=modes, effect=SimpleNamespace(signals=signals))
    return trials.Trial(term, gain, solved)  # type: ignore[arg-type]


@pytest.mark.parametrize(("signal", "holds"), [(Signal.NONRECIPROCAL, True), (Signal.READINGS, False)])
def test_an_instrument_s_form_is_freed_before_it_is_said_to_spoil_frames(
    signal: Signal, holds: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    incumbent, wrong, freed = (CheckedFit(PROBLEM, None, misfit, 0.0) for misfit in (3.0, 3.1, 2.0))  # type: ignore[arg-type]
    monkeypatch.setattr(settling, "settled", lambda build, solved: wrong)
    monkeypatch.setattr(entering, "refined", lambda build, fit, partitions: freed)
    found = entering.first_to_hold(None, incumbent, [trial("wrong", "one", 50.0, signals=(signal,))], [])  # type: ignore[arg-type]
    assert (found is not None) is holds
    if found is not None:
        assert found[1] is freed


@pytest.mark.parametrize(("gain", "best"), [(30.0, "second"), (20.0, "first")])
def test_of_forms_that_gain_alike_the_one_that_fits_best_where_it_settles(
    gain: float, best: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    incumbent, first, second = (CheckedFit(PROBLEM, None, misfit, 0.0) for misfit in (3.0, 2.0, 1.5))  # type: ignore[arg-type]
    settle = {"first": first, "second": second}
    monkeypatch.setattr(settling, "settled", lambda build, solved: settle[solved])
    trials = [trial("first", "spot", 50.0), trial("second", "spot", gain)]
    found = entering.first_to_hold(None, incumbent, trials, [])  # type: ignore[arg-type]
    assert found is not None
    assert found[1] is settle[best]
    # A rival is short of what the effect gains in its best form.
    assert found[0].gain == 50.0


@pytest.mark.parametrize(("predicted", "misfit", "best"), [(5.0, 1.5, "few"), (30.0, 1.5, "free"), (5.0, 2.2, "free")])
def test_of_forms_of_a_field_that_explain_alike_the_one_that_predicts_cells_best(
    predicted: float, misfit: float, best: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    settle = {
        name: CheckedFit(PROBLEM, name, rms, 0.0)  # type: ignore[arg-type]
        for name, rms in (("free", 1.4), ("few", misfit))
    }
    monkeypatch.setattr(settling, "settled", lambda build, solved: settle[solved])
    costs = {"free": 20.0, "few": predicted}
    monkeypatch.setattr(entering, "_predicting", lambda fit, partitions: costs[fit.solved])
    incumbent = CheckedFit(PROBLEM, None, 3.0, 0.0)  # type: ignore[arg-type]
    trials = [trial("free", "field", 50.0, modes="many"), trial("few", "field", 45.0)]
    found = entering.first_to_hold(None, incumbent, trials, [[0], [1]])  # type: ignore[arg-type]
    assert found is not None
    assert found[1] is settle[best]


def test_where_the_work_is_spent_a_field_has_the_form_of_fewest_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence = SimpleNamespace(criteria=DEFAULT, work=Work(MOST))
    problem: Any = SimpleNamespace(evidence=evidence)
    counts = {"free": 40, "few": 12}
    solved: dict[str, Any] = {
        name: SimpleNamespace(fit=SimpleNamespace(value=np.zeros(count))) for name, count in counts.items()
    }
    settle = {id(one): CheckedFit(problem, one, 1.4 if name == "free" else 1.5, 0.0) for name, one in solved.items()}
    monkeypatch.setattr(settling, "settled", lambda build, one: settle[id(one)])
    monkeypatch.setattr(entering, "_predicting", lambda *given: pytest.fail("fitted"))
    incumbent = CheckedFit(problem, None, 3.0, 0.0)  # type: ignore[arg-type]
    trials = [trial(solved["free"], "field", 50.0, modes="many"), trial(solved["few"], "field", 45.0)]
    found = entering.first_to_hold(None, incumbent, trials, [[0], [1]])  # type: ignore[arg-type]
    assert found is not None
    assert found[1].solved is solved["few"]
    assert evidence.work.has_ended


def test_a_form_that_gains_less_has_its_turn_where_the_best_spoils(monkeypatch: pytest.MonkeyPatch) -> None:
    incumbent, wild, tame = (CheckedFit(PROBLEM, None, misfit, 0.0) for misfit in (3.0, 9.0, 2.0))  # type: ignore[arg-type]
    monkeypatch.setattr(settling, "settled", lambda build, solved: {"wild": wild, "tame": tame}[solved])
    trials = [trial("wild", "spot", 100.0), trial("tame", "spot", 30.0)]
    found = entering.first_to_hold(None, incumbent, trials, [])  # type: ignore[arg-type]
    assert found is not None
    assert found[1] is tame


def test_an_interval_is_no_narrower_than_forms_differ_and_keeps_to_the_range() -> None:
    width = PiezoHysteresis.parameters()["width"]
    assert estimate(0.1, 0.01, width).high == pytest.approx(0.1 + 0.01645)
    assert estimate(0.1, 1e-9, width).low == pytest.approx(0.1 * (1 - FORM))
    assert estimate(0.1, 1.0, width).low == width.low


@pytest.mark.parametrize("error", [MeshError("a pad overlaps another"), np.linalg.LinAlgError()])
def test_a_trial_that_settles_where_no_sheet_is_gives_way_too(error: Exception, monkeypatch: Any) -> None:
    def settle(build: Any, solved: Any) -> CheckedFit:
        if solved == "nowhere":
            raise error
        return tame

    incumbent, tame = (CheckedFit(PROBLEM, None, misfit, 0.0) for misfit in (3.0, 2.0))  # type: ignore[arg-type]
    monkeypatch.setattr(settling, "settled", settle)
    trials = [trial("nowhere", "one", 50.0), trial("there", "other", 40.0)]
    found = entering.first_to_hold(None, incumbent, trials, [])  # type: ignore[arg-type]
    assert found is not None
    assert (found[0].solved, found[1]) == ("there", tame)


def test_a_term_nearer_to_nought_keeps_its_place_and_loses_its_size() -> None:
    field = ((0.1, 0.2), (0.3, 0.4))
    effect = PiezoInhomogeneity(amplitude=0.4, x_m=0.05, gradient_x=-0.2, nodes=field)
    nearer = Term(effect, ("amplitude", "x_m", "gradient_x")).nearer(0.5).effect
    assert nearer == PiezoInhomogeneity(amplitude=0.2, x_m=0.05, gradient_x=-0.1, nodes=((0.05, 0.1), (0.15, 0.2)))


@pytest.mark.parametrize(
    ("costs", "tried", "chosen"), [([9.0], 1, 9.0), ([50.0, 8.0], 2, 8.0), ([50.0, 40.0, 30.0], 3, 30.0)]
)
def test_a_fit_that_does_not_come_back_is_begun_from_nearer(costs: list[float], tried: int, chosen: float) -> None:
    widths: list[float] = []

    def solve(terms: list[Term], calibration: Any, steps: int, leftover: bool) -> Any:
        widths.append(terms[-1].effect.width)  # type: ignore[attr-defined]
        return SimpleNamespace(cost=costs[len(widths) - 1])

    problem: Any = SimpleNamespace(solve=solve)
    current: Any = SimpleNamespace(terms=(), calibration=None, cost=10.0)
    found = trials._with_term(problem, current, Term(PiezoHysteresis(width=0.2), ("width",)), leftover=False)
    assert found.cost == chosen
    assert widths == pytest.approx([0.2 * share for share in trials.SHARES[:tried]])


def test_a_drift_must_show_where_nothing_presses() -> None:
    rest = np.array([True, True, False, False])
    problem: Any = SimpleNamespace(evidence=SimpleNamespace(rest=rest, criteria=DEFAULT), weight=np.ones(4))

    def residual(resting: float, pressed: float) -> Any:
        return SimpleNamespace(scan_residual=np.where(rest, resting, pressed)[:, None] * np.ones((4, 20)))

    before = residual(2.0, 5.0)
    assert trials._shown_at_rest(problem, before, residual(1.0, 5.0))
    assert not trials._shown_at_rest(problem, before, residual(2.0, 1.0))


@pytest.mark.parametrize(("first", "further"), [(-5.0, 95.0), (40.0, 40.0)])
def test_the_candidate_that_fits_best_is_fitted_to_its_end_where_it_predicts_worse(
    first: float, further: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fit(term: Term, cost: float, gain: float) -> Any:
        return SimpleNamespace(terms=(term,), calibration=None, cost=cost, gain=gain)

    loop, spot = Term(PiezoHysteresis(width=0.1), ("width",)), Term(PiezoInhomogeneity(amplitude=0.1), ("amplitude",))
    begun = {loop.name: fit(loop, 3.0, first), spot.name: fit(spot, 70.0, 20.0)}
    problem: Any = SimpleNamespace(
        reuse=False, solve=lambda terms, start, leftover: fit(terms[0], 3.0, 95.0), evidence=PROBLEM.evidence
    )
    monkeypatch.setattr(trials, "_with_term", lambda problem, current, term, leftover: begun[term.name])
    monkeypatch.setattr(trials, "gained", lambda without, present, partitions, criteria: present.gain)
    monkeypatch.setattr(trials, "_with_remainders", lambda problem, trials, partitions, least: ())
    monkeypatch.setattr(trials, "of_frames", lambda solved: solved.cost)
    monkeypatch.setattr(trials, "worth_a_name", lambda problem, current: 30.0)
    candidates = [Candidate(term, 0.0) for term in (loop, spot)]
    found = trials._try(problem, fit(loop, 100.0, 0.0), candidates, [])
    assert [t.gain for t in found] == [further, 20.0]


@pytest.mark.parametrize(("gained_there", "kept"), [(60.0, 60.0), (2.0, 5.0)])
def test_a_first_candidate_that_gains_too_little_is_judged_where_it_settles(
    gained_there: float, kept: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    offset, loop = Term(IndenterOffset(dx_m=5e-3), ("dx_m",)), Term(PiezoHysteresis(width=0.1), ("width",))
    gains = {offset.name: 5.0, loop.name: 20.0}
    problem: Any = SimpleNamespace(reuse=False, evidence=PROBLEM.evidence)
    current, settled = fit_of(loop, 0.0), fit_of(offset, gained_there)
    monkeypatch.setattr(trials, "_with_term", lambda problem, current, term, leftover: fit_of(term, gains[term.name]))
    monkeypatch.setattr(trials, "gained", lambda without, present, partitions, criteria: present.gain)
    monkeypatch.setattr(trials, "_with_remainders", lambda problem, trials, partitions, least: ())
    monkeypatch.setattr(trials, "of_frames", lambda solved: 0.0)
    monkeypatch.setattr(trials, "worth_a_name", lambda problem, current: 30.0)
    found: dict[float, list[float]] = {}
    for expected in (100.0, 29.0):
        candidates = [Candidate(offset, expected), Candidate(loop, 25.0)]
        settle: Any = lambda solved: SimpleNamespace(solved=settled, problem=problem)  # noqa: E731
        found[expected] = [t.gain for t in trials._try(problem, current, candidates, [], 0.0, settle)]
    # What isn't expected to be worth a name isn't looked at again.
    assert found == {100.0: [kept, 20.0], 29.0: [5.0, 20.0]}


def fit_of(term: Term, gain: float) -> Any:
    return SimpleNamespace(terms=(term,), calibration=None, cost=1.0, gain=gain, leftover=False)


def test_what_is_material_of_the_scans_does_not_hang_on_what_no_network_explains() -> None:
    fit = Fit(np.zeros(1), Quadratic(np.array([9e5, 0.0]), np.zeros((2, 1)), np.zeros((2, 1, 1))), np.zeros((1, 1)), 1)
    solved = Solved(None, (), fit, np.full((100, 10), 1.2))  # type: ignore[arg-type]
    least = trials.material_cost(1000, trials.of_scans(solved), DEFAULT.material_ratio)
    assert least == pytest.approx(0.5 * 1000 * (1.03**2 - 1) * 1.2)


def test_a_smooth_field_beside_a_form_must_be_expected_to_gain_what_the_form_leaves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    spot = Term(PiezoInhomogeneity(amplitude=0.1), ("amplitude",))
    asked: list[float] = []
    monkeypatch.setattr(trials, "of_frames", lambda solved: 0.0)
    monkeypatch.setattr(
        trials, "with_smooth_field", lambda problem, solved, number, partitions, least: asked.append(least)
    )
    form = trials.Trial(spot, 12.0, fit_of(spot, 12.0))
    assert not list(trials._with_remainders(PROBLEM, [form], [], 60.0))
    assert asked == [48.0]

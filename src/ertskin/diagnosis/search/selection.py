"""Which effects a recording shows: forward selection by held-out likelihood, then backward, with what else would do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ertskin.diagnosis.contract.claims import Rival, Tried
from ertskin.diagnosis.criteria import Criteria
from ertskin.diagnosis.fit.full_solution_check import CheckedFit, Problem, checked_fit, exact, settled
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term
from ertskin.diagnosis.linear.calibration_vector import Calibration
from ertskin.diagnosis.search.backward import backward, with_fields_by_place, with_lag
from ertskin.diagnosis.search.behind_fields import behind_field, smooth_fields_of
from ertskin.diagnosis.search.candidates import screen
from ertskin.diagnosis.search.chosen import Chosen, Rivals, Selection, carried, key_of
from ertskin.diagnosis.search.contact_paths import (
    as_good_at_rest,
    without_paths,
    without_paths_of_drifting_channels,
)
from ertskin.diagnosis.search.entering import first_to_hold, likely, of_few_numbers, promises, short_of
from ertskin.diagnosis.search.exchange import exchanged, gain_of_exchange, leaves_a_mismatch
from ertskin.diagnosis.search.form_error import form_error
from ertskin.diagnosis.search.gain import gained
from ertskin.diagnosis.search.nominal_ratio import at_nominal, has_run_away, let_go, near_nominal, reconsidered
from ertskin.diagnosis.search.other_forms import OtherForm, may_be_likelier, other_forms
from ertskin.diagnosis.search.pressed_places import explains_most, with_field_by_place
from ertskin.diagnosis.search.settling import Freeing, freed_forms, refined, spread, where_it_settles
from ertskin.diagnosis.search.trials import (
    Trial,
    compatible_with_instrument,
    instrument_worth_a_name,
    rms_of,
    trials_of,
    worth_a_name,
    worthy,
)
from ertskin.diagnosis.specimen.signal import is_memory, remembers_alike
from ertskin.physics.conduction.mesh import MeshError
from ertskin.physics.effects.effect import ElectrodeEffect
from ertskin.physics.effects.piezo_chain import in_fabric

MOST_TERMS = 5
"""Terms that are searched for, those of another signal among them."""
FORM_ERROR = "form_error"
"""What sets tried with a nameless part of the instrument's effects are said to hold."""
Report = Callable[[float | None, str], None]


def select(
    build: Problem,
    fixed: Sequence[Term],
    begun: Sequence[tuple[Term, Rivals]],
    start: Calibration,
    partitions: Sequence[Sequence[int]],
    report: Report,
) -> Selection:
    """Grow the set of terms while one gains, held out, what is significant and material; then prune.

    ``build`` linearises about a fit (or about the start); ``fixed`` terms (the force stage's) belong to every model;
    ``begun`` are terms that another signal has shown, with their rivals there: they must hold their own here.
    """
    report(0.15, "fitting the calibration")
    incumbent = _calibrated(build, fixed, start)
    before = incumbent.solved
    proposed = _begun(build, incumbent, [*fixed, *(term for term, _ in begun)]) if begun else None
    if proposed is not None:
        incumbent, fixed = _without_drifts(build, proposed, fixed)
    search = _Search(build, partitions, report, len(fixed), {key_of(term): rivals for term, rivals in begun})
    if proposed is not None:
        incumbent = search.begun_with(incumbent)
    incumbent = search.begun_at_nominal(incumbent)
    chosen, incumbent = search.found(incumbent) if begun else search.found_remembering(incumbent, start)
    specimen = None if incumbent.problem.specimen is None else "agrees"
    if search.disagrees or search.specimen_differs(incumbent):
        if not search.disagrees:
            # What made up for another fabric's law on the way goes first.
            _, incumbent = search.pruned(search.by_own_readings(incumbent))
            chosen, incumbent = search.found(incumbent)
        specimen, before = "disagrees", _calibrated(search.build, fixed, start).solved
    return search.completed(before, chosen, incumbent, specimen)


def selected_again(
    selection: Selection, build: Problem, partitions: Sequence[Sequence[int]], report: Report
) -> Selection:
    """The selection's terms fitted to the frames of ``build``: fields spread otherwise where that predicts better,
    those told place by place are told by these frames' places, and what these frames don't show goes.

    Raises ``MeshError`` where there is no such sheet.
    """
    found, begun = selection.after, selection.before
    before = build(begun).solve(begun.terms, begun.calibration)
    fixed = len(found.terms) - len(selection.chosen)
    search = _Search(build, partitions, report, fixed, {key_of(term): one.rivals for term, one in selection.found})
    kept = [term for term in found.terms if not term.by_place]
    incumbent = where_it_settles(build, None, build(found).solve(kept, found.calibration))
    if incumbent is None:
        raise MeshError("what some presses have shown can't be meshed with all of them")
    # What forms they take has been chosen on presses enough to tell.
    incumbent = refined(build, incumbent, partitions, spread)
    if len(kept) < len(found.terms):
        incumbent = search.with_values_at_places(incumbent, spread) or incumbent
    return search.completed(before, *search.pruned(incumbent), selection.specimen)


def _calibrated(build: Problem, fixed: Sequence[Term], start: Calibration) -> CheckedFit:
    """The calibration fitted from its start, linearised about itself where the start is too far."""
    problem = build(None)
    fit = checked_fit(problem, problem.solve(fixed, start))
    return settled(build, fit.solved) if fit.linearisation_fails else fit


@dataclass(eq=False)
class _Search:
    """The sets of terms visited so far: ``stand`` keeps each term's rivals, ``tried`` every set fitted, in order.

    The first ``fixed`` terms belong to every set. ``forms``: other forms of what entered.
    """

    build: Problem
    partitions: Sequence[Sequence[int]]
    report: Report
    fixed: int
    stand: dict[str, Rivals]
    tried: list[Tried] = field(default_factory=list)
    disagrees: bool = False
    forms: list[OtherForm] = field(default_factory=list)

    def begun_with(self, incumbent: CheckedFit) -> CheckedFit:
        """A fit with what another signal has shown once more of it is free; without the specimen at once where the skin
        has nothing of what that remembers."""
        problem, current = incumbent.problem, incumbent.solved
        still = [term for term in current.terms if not is_memory(term.effect)]
        if len(still) < len(current.terms) and self.specimen_differs(incumbent):
            without = problem.solve(still, current.calibration, leftover=current.leftover)
            gain = gained(without, current, self.partitions, problem.evidence.criteria)
            if gain < problem.evidence.criteria.significant_gain:
                return self.by_own_readings(replace(incumbent, solved=without))
        # A form is freed about the fit itself: further off it would mend what linearising leaves.
        return refined(self.build, incumbent, self.partitions)

    def grown(self, incumbent: CheckedFit, until: Callable[[CheckedFit], bool] = lambda fit: False) -> CheckedFit:
        """With one term more after the other, while one gains enough and they aren't too many, ``until`` a fit will do;
        asked once at least, but not beside others once the work is spent."""
        for turn in range(min(len(incumbent.solved.terms) - self.fixed, MOST_TERMS - 1), MOST_TERMS):
            text = f"looking for what is missing (residual {rms_of(incumbent.solved):.3f} of the noise)"
            self.report(0.2 + 0.1 * turn, text)
            if turn and incumbent.problem.evidence.work.ends():
                break
            proposed = self._entered(incumbent)
            if proposed is None:
                break
            incumbent = proposed
            self.report(0.25 + 0.1 * turn, f"{incumbent.solved.terms[-1].name} enters")
            if until(incumbent):
                break
        return incumbent

    def _entered(self, incumbent: CheckedFit) -> CheckedFit | None:
        """With the likeliest term more, and without what that makes superfluous; None where none gains enough."""
        proposed = self.one_more(incumbent)
        return None if proposed is None else self._without_drifts(self._where_readings_remember(proposed))

    def begun_at_nominal(self, incumbent: CheckedFit) -> CheckedFit:
        """With the first term looked for near the nominal ratio of moduli, where the fit's has run away and something
        is missing all the same, and the ratio let go; the fit itself where none enters or stays."""
        incumbent = reconsidered(self.build, incumbent)
        few = len(incumbent.solved.terms) - self.fixed < MOST_TERMS
        missing = incumbent.misfit > incumbent.problem.evidence.criteria.mismatch_ratio
        if not (few and missing and has_run_away(incumbent.solved)):
            return incumbent
        self.report(0.18, "looking for what is missing, the foam nearly as its data sheet says")
        other = self._apart()
        other.build = near_nominal(self.build)
        begun = where_it_settles(other.build, None, at_nominal(incumbent.solved))
        reached = None if begun is None else other._entered(begun)
        other.build = let_go(other.build)
        proposed = None if reached is None else where_it_settles(other.build, None, reached.solved)
        if proposed is None or proposed.spoils(incumbent):
            self._came_to_nothing(other)
            return incumbent
        self._go_on_as(other)
        self.forms = other.forms
        return proposed

    def found(self, incumbent: CheckedFit) -> tuple[tuple[Chosen, ...], CheckedFit]:
        """All that is missing from a fit: grown, pruned, and its forms and fields asked for once more."""
        return self.fields_reconsidered(*self.with_other_forms(*self.pruned(self.grown(incumbent))))

    def found_remembering(self, incumbent: CheckedFit, start: Calibration) -> tuple[tuple[Chosen, ...], CheckedFit]:
        """All that is missing, with what places keep of presses in the stead of contacts that wander where it explains
        rest as well and stays.

        What a press leaves behind changes every reading near it, and contacts found at rest, before any press is looked
        at, share that out; beside them a memory gains less than it explains.
        """
        other = self._apart()
        remembering = other._remembering(incumbent, start)
        if remembering is not None:
            chosen, reached = other.found(remembering)
            if _remembers_air(reached.solved):
                self._go_on_as(other)
                return chosen, reached
        self._came_to_nothing(other)
        return self.found(incumbent)

    def _remembering(self, incumbent: CheckedFit, start: Calibration) -> CheckedFit | None:
        """The fit with a memory that shows in air and no contacts that wander; None where they do better beside it."""
        terms = incumbent.solved.terms
        still = without_paths(terms)
        if len(still) == len(terms):
            return None
        self.fixed = len(without_paths(terms[: self.fixed]))
        proposed = self.one_more(_calibrated(self.build, still, start), _may_remember_air)
        if proposed is None or not _remembers_air(proposed.solved):
            return None
        proposed = self._where_readings_remember(proposed)
        return proposed if _as_good_alone(self.build, proposed, terms) else None

    def specimen_differs(self, incumbent: CheckedFit) -> bool:
        """Whether the skin remembers otherwise than the specimen: two pieces of fabric, each with its own law."""
        specimen, criteria = incumbent.problem.specimen, incumbent.problem.evidence.criteria
        return specimen is not None and not remembers_alike(specimen, incumbent.solved.effects, criteria)

    def _where_readings_remember(self, incumbent: CheckedFit) -> CheckedFit:
        """Without the specimen from when the skin is seen to remember what a specimen without memory doesn't."""
        specimen = incumbent.problem.specimen
        if specimen is None or specimen.effects or not self.specimen_differs(incumbent):
            return incumbent
        return self.by_own_readings(incumbent)

    def by_own_readings(self, incumbent: CheckedFit) -> CheckedFit:
        """The fit without the specimen, and all that follow; as linearised here where it settles nowhere."""
        build = self.build
        self.disagrees, self.build = True, lambda solved: replace(build(solved), specimen=None)
        proposed = where_it_settles(self.build, None, incumbent.solved)
        if proposed is None:
            without, solved = replace(incumbent.problem, specimen=None), incumbent.solved
            return checked_fit(without, without.solve(solved.terms, solved.calibration))
        return reconsidered(self.build, proposed)

    def _without_drifts(self, incumbent: CheckedFit) -> CheckedFit:
        """Without contacts that wander, where places that have not recovered, or drifting channels, explain them."""
        incumbent, fixed = _without_drifts(self.build, incumbent, incumbent.solved.terms[: self.fixed])
        self.fixed = len(fixed)
        return incumbent

    def one_more(self, incumbent: CheckedFit, wanted: Callable[[Trial], bool] | None = None) -> CheckedFit | None:
        """With the likeliest term more; None where none gains enough, or where none of the likely ones is ``wanted``:
        settling and freeing the others is most of the work."""
        problem, current = incumbent.problem, incumbent.problem.at_hand(incumbent.solved)
        found = screen(problem, current, self.partitions)
        left = form_error(problem, current, self.partitions, current.effects).gain
        least = worth_a_name(problem, current)
        settle = partial(_gone_elsewhere, self.build, problem)
        lists = trials_of(problem, current, found, self.partitions, left, settle)
        trials, last, entered = self._first_to_enter(incumbent, lists, wanted)
        if entered is None and trials and not _holds_likely(last or trials, wanted, problem.evidence.criteria):
            self.tried += [_as_tried(trial, False) for trial in trials]
            return None
        if entered is not None:
            entered = of_few_numbers(self.build, incumbent, entered, last, self.partitions)
        self.tried += [_as_tried(t, entered is not None and t.term == entered[0].term) for t in trials]
        if left >= least:
            named = entered is not None and entered[0].term.name not in {t.name for t in current.terms}
            self.tried.append(Tried((*(t.name for t in current.terms), FORM_ERROR), left, not named))
        if entered is None:
            instrument = instrument_worth_a_name(problem, current, trials)
            least = 0.0 if instrument is None else problem.evidence.criteria.most_share * instrument.gain
            swapped = self._in_anothers_place(incumbent, trials)
            return swapped or (self._with_places_and_another(incumbent, least) if wanted is None else None)
        trial, proposed = entered
        rivals = self.stand[key_of(trial.term)] = short_of(trial, last)
        self.forms += other_forms(trial, last, rivals, self.fixed)
        return self._refined(reconsidered(self.build, proposed))

    def _refined(self, fit: CheckedFit, free: Freeing = freed_forms) -> CheckedFit:
        """The fit with more of it free; terms keep their rivals."""
        found = refined(self.build, fit, self.partitions, free)
        carried(self.stand, fit.solved.terms, found.solved.terms)
        return found

    def _first_to_enter(
        self, incumbent: CheckedFit, lists: Iterable[list[Trial]], wanted: Callable[[Trial], bool] | None
    ) -> tuple[list[Trial], list[Trial], tuple[Trial, CheckedFit] | None]:
        """The trials of the ``lists``, up to where one enters or none of the likely ones is ``wanted``, those of the
        last list, and the first of them worth a name that holds where it settles."""
        trials, fitted = list[Trial](), list[Trial]()
        for fitted in lists:
            trials += fitted
            named = worthy(incumbent.problem, incumbent.solved, fitted, trials)
            if named and not _holds_likely(fitted, wanted, incumbent.problem.evidence.criteria):
                break
            instrument = instrument_worth_a_name(incumbent.problem, incumbent.solved, trials)
            allowed = compatible_with_instrument(incumbent.problem, named, instrument)
            entered = first_to_hold(self.build, incumbent, allowed, self.partitions)
            if entered is not None:
                return trials, fitted, entered
        return trials, fitted, None

    def _in_anothers_place(self, incumbent: CheckedFit, trials: Sequence[Trial]) -> CheckedFit | None:
        """With a trial's term in the place of one that it may be taken for, where a mismatch stays and that is
        likelier; None where none is.

        The first of two that explain nearly the same hides what the second would gain alone.
        """
        if not leaves_a_mismatch(incumbent):
            return None
        found = exchanged(self.build, incumbent, trials, self.fixed, self.partitions)
        if found is None:
            return None
        left, proposed, gain = found
        entered = proposed.solved.terms[-1]
        self.tried.append(Tried(tuple(term.name for term in proposed.solved.terms), gain, True))
        self.stand[key_of(entered)] = (Rival(left.effect, gain),)
        return reconsidered(self.build, proposed)

    def with_values_at_places(self, incumbent: CheckedFit, free: Freeing) -> CheckedFit | None:
        """With a field told place by place, where that is worth a name."""
        found = with_field_by_place(self.build, incumbent)
        if found is None:
            return None
        self.tried.append(_entering(*found))
        return self._refined(found[0], free)

    def _with_places_and_another(self, incumbent: CheckedFit, least: float) -> CheckedFit | None:
        """With a field told place by place that gains the ``least``, or with that and what ``one_more`` finds beside
        it, where they explain most of what is missing.

        What another effect does is lost in what a field does to every press differently: beside a displaced pad the
        scans' own heat gained nothing, beside that and lots of sensitivity 13 000 in half chi-square (c030 of
        `thirtyfifth40`).
        """
        found = with_field_by_place(self.build, incumbent)
        if found is None or found[1] < least:
            return None
        other, entering = self._apart(), _entering(*found)
        by_place = other._refined(found[0])
        if not explains_most(found[0], incumbent):
            full = len(by_place.solved.terms) - self.fixed >= MOST_TERMS
            both = None if full or incumbent.problem.evidence.work.ends() else other.one_more(by_place)
            if both is None or not explains_most(both, incumbent):
                self._came_to_nothing(other)
                return None
            by_place = both
        other.tried.insert(len(self.tried), entering)
        self._go_on_as(other)
        self.forms = other.forms
        return by_place

    def with_other_forms(
        self, chosen: tuple[Chosen, ...], incumbent: CheckedFit
    ) -> tuple[tuple[Chosen, ...], CheckedFit]:
        """With a form that explained nearly as much as one that entered, or another effect before a field, and what
        follows, where a mismatch stays and that is likelier."""
        forms, self.forms = self.forms, []
        if incumbent.misfit <= incumbent.problem.evidence.criteria.mismatch_ratio:
            return chosen, incumbent
        least = worth_a_name(incumbent.problem, incumbent.solved)
        for form in forms:
            if incumbent.problem.evidence.work.ends():
                break
            other = self._apart()
            begun = other._in_form(incumbent, form)
            if begun is None or not may_be_likelier(begun, incumbent, form, least, self.partitions):
                continue
            followed = self._followed(other, begun, incumbent, least)
            if followed is not None:
                return followed
        return chosen, incumbent

    def _in_form(self, incumbent: CheckedFit, form: OtherForm) -> CheckedFit | None:
        """The fit with an effect of the incumbent in another form, or one before its field, and what came before it;
        None where that isn't another one by now, or settles nowhere."""
        if not form.may_replace(incumbent.solved.terms, self.fixed):
            return None
        fit = where_it_settles(self.build, None, form.trial.solved)
        if fit is None:
            return None
        self.stand[key_of(form.trial.term)] = form.rivals
        proposed = self._refined(reconsidered(self.build, fit))
        return self._without_drifts(self._where_readings_remember(proposed))

    def fields_reconsidered(
        self, chosen: tuple[Chosen, ...], incumbent: CheckedFit
    ) -> tuple[tuple[Chosen, ...], CheckedFit]:
        """With what takes a field's place once the terms that entered after it are there, and what follows.

        While others are missing a field also takes up some of what they do, and wins against a form of few numbers
        that explains all the rest: a pad out of place on a sheet that warms was one of a hundred modes.
        """
        for number in range(self.fixed, len(incumbent.solved.terms) - 1):
            if incumbent.problem.evidence.work.ends():
                break
            other = self._apart()
            proposed = other._in_a_fields_place(incumbent, number)
            if proposed is not None:
                others, reached = other.pruned(other.grown(proposed))
                if not reached.spoils(incumbent):
                    self._go_on_as(other)
                    return others, reached
            self._came_to_nothing(other)
        return self._with_what_fields_hide(chosen, incumbent)

    def _with_what_fields_hide(
        self, chosen: tuple[Chosen, ...], incumbent: CheckedFit
    ) -> tuple[tuple[Chosen, ...], CheckedFit]:
        """With what a smooth field stands in for entered before it, or in its stead, where all that follows is
        likelier.

        A field of a hundred modes takes up most of what an even effect does: anisotropy was worth 68 in half chi-square
        beside one and 924 before it (c012 of `nineteenth96`).
        """
        least = incumbent.problem.evidence.criteria.significant_gain
        for number in smooth_fields_of(incumbent.solved, self.fixed):
            if incumbent.problem.evidence.work.ends():
                break
            hidden = [one for one in behind_field(incumbent.problem, incumbent.solved, number) if one.gain > least]
            other, field_term = self._apart(), incumbent.solved.terms[number]
            proposed = other._with_in_stead(incumbent, number, hidden[0].term) if hidden else None
            if proposed is None or not promises(incumbent, proposed, field_term, self.partitions):
                continue
            field_itself = Rival(field_term.effect, hidden[0].gain)
            other.stand[key_of(hidden[0].term)] = (*short_of(hidden[0], hidden), field_itself)
            followed = self._followed(other, proposed, incumbent, least)
            if followed is not None:
                return followed
        return chosen, incumbent

    def _followed(
        self, other: _Search, begun: CheckedFit, incumbent: CheckedFit, least: float
    ) -> tuple[tuple[Chosen, ...], CheckedFit] | None:
        """All that follows from where another search has begun, gone on with where that is likelier than the incumbent
        by more than the ``least``; None where it comes to nothing, as it does once it holds all names of the incumbent
        and is no likelier: whatever follows would beside that, too."""

        def no_better(fit: CheckedFit) -> bool:
            missing = {term.name for term in incumbent.solved.terms} - {term.name for term in fit.solved.terms}
            return not missing and gain_of_exchange(incumbent, fit) <= least

        chosen, reached = other.pruned(other.grown(begun, no_better))
        gain = gain_of_exchange(incumbent, reached)
        other.tried.append(Tried(tuple(term.name for term in reached.solved.terms), gain, True))
        if gain > least and not reached.spoils(incumbent) and other.disagrees == self.disagrees:
            self._go_on_as(other)
            return chosen, reached
        self._came_to_nothing(other)
        return None

    def _with_in_stead(self, incumbent: CheckedFit, number: int, entering: Term) -> CheckedFit | None:
        """The fit with a term in the stead of the one of this ``number``; None where it settles nowhere."""
        problem, current = incumbent.problem, incumbent.solved
        rest = [*current.terms[:number], *current.terms[number + 1 :], entering]
        begun = problem.solve(rest, current.calibration, leftover=current.leftover)
        proposed = where_it_settles(self.build, problem, begun)
        if proposed is None:
            return None
        return self._without_drifts(self._where_readings_remember(self._refined(proposed)))

    def _apart(self) -> _Search:
        """Another search that begins with this one and leaves it as it is."""
        return replace(self, stand=dict(self.stand), tried=list(self.tried), forms=list(self.forms))

    def _go_on_as(self, other: _Search) -> None:
        """Take over what another search that began with this one has come to."""
        self.build, self.fixed, self.disagrees = other.build, other.fixed, other.disagrees
        self.stand, self.tried = other.stand, other.tried

    def _came_to_nothing(self, other: _Search) -> None:
        """Remember what another search that began with this one has tried."""
        self.tried += [replace(one, kept=False) for one in other.tried[len(self.tried) :]]

    def _in_a_fields_place(self, incumbent: CheckedFit, number: int) -> CheckedFit | None:
        """The fit with the likeliest term in the place of the smooth field of this ``number``; None where that is the
        field."""
        problem, current = incumbent.problem, incumbent.solved
        field = current.terms[number]
        if field.modes is None or field.by_place:
            return None
        rest = [*current.terms[:number], *current.terms[number + 1 :]]
        begun = problem.solve(rest, current.calibration, leftover=current.leftover)
        without = where_it_settles(self.build, problem, begun)
        proposed = None if without is None else self.one_more(without, lambda trial: trial.term.name != field.name)
        return None if proposed is None or proposed.solved.terms[-1].name == field.name else proposed

    def pruned(self, incumbent: CheckedFit) -> tuple[tuple[Chosen, ...], CheckedFit]:
        """What is left without terms that the others have made superfluous, where the skin is the linearised one."""
        chosen, current = backward(incumbent.problem, incumbent.solved, self.fixed, self.partitions, self.stand)
        proposed = where_it_settles(self.build, incumbent.problem, current)
        if proposed is None:
            return chosen, replace(incumbent, solved=current)
        if proposed.problem is incumbent.problem:
            return chosen, proposed
        # What is left may fit as well elsewhere only because the skin was linearised far from there.
        chosen, current = backward(proposed.problem, proposed.solved, self.fixed, self.partitions, self.stand)
        return chosen, replace(proposed, solved=current)

    def completed(
        self, before: Solved, chosen: tuple[Chosen, ...], incumbent: CheckedFit, specimen: str | None
    ) -> Selection:
        """What was found, fields told place by place where these say more, fitted where the skin is solved in full."""
        problem, current = incumbent.problem, incumbent.solved
        if chosen:
            first = len(current.terms) - len(chosen)
            lagging = (with_lag(problem, current, first + k, one, self.partitions) for k, one in enumerate(chosen))
            chosen, incumbent = with_fields_by_place(self.build, incumbent, tuple(lagging), self.partitions)
            problem, current = _in_full(incumbent.problem, incumbent.solved)
        return Selection(before, current, chosen, problem, tuple(self.tried), specimen)


def _holds_likely(trials: Sequence[Trial], wanted: Callable[[Trial], bool] | None, criteria: Criteria) -> bool:
    """Whether one of the likely trials is ``wanted``, as all are where nothing in particular is."""
    return wanted is None or any(map(wanted, likely(trials, criteria)))


def _entering(fit: CheckedFit, gain: float) -> Tried:
    """What is said of a fit whose last term enters with this gain."""
    return Tried(tuple(term.name for term in fit.solved.terms), gain, True)


def _as_tried(trial: Trial, kept: bool) -> Tried:
    return Tried(tuple(term.name for term in trial.solved.terms), trial.gain, kept)


def _in_full(problem: VoltageProblem, current: Solved) -> tuple[VoltageProblem, Solved]:
    """The fit where the skin is solved in full.

    The sheet that a last step leads to may not be one that can be meshed: then the fit stays as it is.
    """
    try:
        return exact(problem, current)
    except (MeshError, np.linalg.LinAlgError):
        return problem, current


def _begun(build: Problem, without: CheckedFit, terms: Sequence[Term]) -> CheckedFit | None:
    """The fit with terms that another signal has shown; a pad that lies elsewhere needs a mesh of its own first."""
    calibration = without.solved.calibration
    displaced = [
        int(getattr(t.effect, "electrode", -1))
        for t in terms
        if isinstance(t.effect, ElectrodeEffect) and t.effect.displaces()
    ]
    if displaced:
        contacts = np.array(calibration.contact_ohm)
        # What its contact was fitted to at the wrong place says nothing.
        contacts[displaced] = np.median(contacts)
        begin = without.problem.solve(terms, replace(calibration, contact_ohm=contacts), steps=0)
    else:
        begin = without.problem.solve(terms, calibration)
    return where_it_settles(build, None, begin)


def _without_drifts(build: Problem, incumbent: CheckedFit, fixed: Sequence[Term]) -> tuple[CheckedFit, Sequence[Term]]:
    """The fit and its fixed terms without contacts that wander, where places that creep, or channels of theirs that
    drift, explain as much at rest."""
    terms = incumbent.solved.terms
    if _remembers_air(incumbent.solved):
        still = without_paths(terms)
    else:
        still = without_paths_of_drifting_channels(terms, incumbent.problem.evidence.protocol)
    if len(still) == len(terms):
        return incumbent, fixed
    proposed = where_it_settles(build, None, incumbent.problem.solve(still, incumbent.solved.calibration))
    if proposed is None or proposed.spoils(incumbent) or not as_good_at_rest(proposed, incumbent):
        return incumbent, fixed
    # Fitted, the fixed ones are the first of the terms.
    return proposed, [one for one, term in zip(fixed, terms, strict=False) if any(term is kept for kept in still)]


def _as_good_alone(build: Problem, fit: CheckedFit, contacts: Sequence[Term]) -> bool:
    """Whether a fit with a memory, its last term, is as good as one that has it beside the terms with ``contacts`` that
    wander, at rest too."""
    problem, solved = fit.problem, fit.solved
    begun = problem.solve([*contacts, solved.terms[-1]], solved.calibration, leftover=solved.leftover)
    both = where_it_settles(build, problem, begun)
    return both is None or (not fit.spoils(both) and as_good_at_rest(fit, both))


def _remembers_air(solved: Solved) -> bool:
    """Whether something of a fit shows where nothing presses any longer."""
    return any(getattr(part, "remembers_air", False) for part in in_fabric(solved.effects))


def _may_remember_air(trial: Trial) -> bool:
    """Whether something of a trial shows where nothing presses any longer, or could in another form."""
    return any(hasattr(part, "remembers_air") for part in in_fabric(trial.solved.effects))


def _gone_elsewhere(build: Problem, problem: VoltageProblem, solved: Solved) -> CheckedFit | None:
    """Where a fit of the ``problem`` comes to rest; None where it rests already."""
    fit = where_it_settles(build, problem, solved)
    return None if fit is None or fit.problem is problem else fit

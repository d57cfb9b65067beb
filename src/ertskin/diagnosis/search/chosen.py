"""What a search has chosen: terms with what each is worth, and the fits with and without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ertskin.diagnosis.contract.claims import Rival, Tried
from ertskin.diagnosis.fit.joint_fit import VoltageProblem
from ertskin.diagnosis.fit.solved import Solved
from ertskin.diagnosis.fit.terms import Term

Rivals = tuple[Rival, ...]


@dataclass(frozen=True, eq=False)
class Chosen:
    """A selected term: what the fit loses without it and what the best other candidate gains in its stead.

    Beside a field that stands in for it the ``loss`` is what it explains with that as it is. ``ratio_alone``: rms over
    noise that this term by itself would make, by the loss. ``confidence``: that of
    another way to choose, which no rule changes; None where it follows from the rivals and the rules. ``by_place``:
    misfits over noise of the presses fitted without the field that it is, and with it told place by place. ``by_lag``:
    what the fit loses if it followed presses at once; None of what has no such limit.
    """

    term: Term
    loss: float
    ratio_alone: float
    rivals: Rivals
    confidence: float | None = None
    by_place: tuple[float, float] | None = None
    by_lag: float | None = None


@dataclass(frozen=True, eq=False)
class Selection:
    """What was found on the frames fitted: the fits without and with the terms, and what each term is worth.

    ``tried``: the sets fitted, in order; ``specimen`` whether it "agrees" or "disagrees" with the skin, None without.
    """

    before: Solved
    after: Solved
    chosen: tuple[Chosen, ...]
    problem: VoltageProblem
    tried: tuple[Tried, ...]
    specimen: str | None = None

    @property
    def found(self) -> list[tuple[Term, Chosen]]:
        """The terms chosen, as they are fitted after the last."""
        terms = self.after.terms[len(self.after.terms) - len(self.chosen) :]
        return list(zip(terms, self.chosen, strict=True))


def carried(stand: dict[str, Rivals], before: Sequence[Term], after: Sequence[Term]) -> None:
    """Let terms ``after`` have the rivals that those at their places had ``before``, in whatever form: one channel's
    crosstalk may have turned out to be that of all."""
    for old, new in zip(before, after, strict=True):
        if key_of(old) in stand:
            stand.setdefault(key_of(new), stand[key_of(old)])


def key_of(term: Term) -> str:
    return f"{term.name}:{getattr(term.effect, 'electrode', getattr(term.effect, 'channel', ''))}"

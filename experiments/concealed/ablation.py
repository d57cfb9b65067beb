"""Each rule of the search switched off, on the same recordings: ``ablation.py OUT TRUTHS RECORDING ... [--rules ...]``.

TRUTHS is the folder of a proof's truths (``OUT/sealed`` of ``record.py`` and ``compounds.py``). Every answer is kept as
OUT/RULE/NAME/diagnosis.json, so that the same command goes on where it stopped; OUT/ablation.md is the table so far.
The answer with all rules keeps how often each acted, and one that never did isn't run again without. Rules that only
lower a name's confidence need no run of their own: a claim's ``reasons`` say what each took, and a second table counts
it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from pkgutil import resolve_name
from time import process_time
from typing import Any
from unittest.mock import patch

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
sys.path.insert(0, str(Path(__file__).parent / "proof"))

import numpy as np  # noqa: E402
from judged import CONFIDENT, LIKELY, Judged  # noqa: E402

from ertskin.diagnosis.fit.full_solution_check import CheckedFit  # noqa: E402
from ertskin.diagnosis.output.diagnosis_file import finite  # noqa: E402
from ertskin.diagnosis.search.form_error import FormError  # noqa: E402
from ertskin.diagnosis.skin import diagnose  # noqa: E402
from ertskin.files import write_whole  # noqa: E402
from ertskin.hardware.recording import read_recording  # noqa: E402

SEARCH, FIT = "ertskin.diagnosis.search", "ertskin.diagnosis.fit"


@dataclass(frozen=True)
class Rule:
    """What a rule does, where it stands, and what takes its place where it is switched off."""

    about: str
    where: tuple[str, ...]
    instead: Callable[..., Any] | float


def _not_by_place(build: Any, incumbent: Any, *of_chosen: Any) -> Any:
    """No field told place by place: none enters, and those chosen stay as they are."""
    return (of_chosen[0], incumbent) if of_chosen else None


RULES: dict[str, Rule] = {
    "form_error": Rule(
        "the instrument's form error is a rival of every further name",
        (f"{SEARCH}.selection.form_error", "ertskin.diagnosis.search.trials.form_error"),
        lambda *given: FormError(),
    ),
    "few_numbers": Rule(
        "a smooth field gives way to a cause of few numbers where both together are likelier",
        (f"{SEARCH}.selection.of_few_numbers",),
        lambda build, incumbent, entered, *more: entered,
    ),
    "form_by_cells": Rule(
        "of a field's forms the one that predicts cells held out enters, not the one that fits best",
        (f"{SEARCH}.entering._predicting",),
        lambda fit, partitions: fit.misfit,
    ),
    "own_scale": Rule(
        "cells held out count each on its own scale of misfit, not by their chi-square",
        (
            f"{SEARCH}.smooth_fields.log_misfit",
            f"{FIT}.cross_validation.log_misfit",
        ),
        lambda cost, numbers: float(cost.sum()),
    ),
    "nominal_again": Rule(
        "a fit whose ratio of moduli has gone far is begun again from nominal",
        (f"{SEARCH}.selection.reconsidered",),
        lambda build, incumbent: incumbent,
    ),
    "nominal_first": Rule(
        "where a fit's ratio of moduli has run away the first term is looked for near nominal",
        (f"{SEARCH}.selection._Search.begun_at_nominal",),
        lambda search, incumbent: incumbent,
    ),
    "mean_covariance": Rule(
        "a field's covariance is the mean of those tried by how well they predict, not the best of them",
        (f"{SEARCH}.smooth_fields._mean_half",),
        lambda halves, weight: halves[int(np.argmax(weight))],
    ),
    "freed": Rule(
        "forms are freed about the fit itself",
        (f"{SEARCH}.selection.refined", f"{SEARCH}.entering.refined", f"{SEARCH}.exchange.refined"),
        lambda build, incumbent, partitions, *free: incumbent,
    ),
    "exchange": Rule(
        "an effect takes the place of one that it may be taken for where that is likelier",
        (f"{SEARCH}.selection.exchanged",),
        lambda build, incumbent, trials, fixed, partitions: None,
    ),
    "own_readings": Rule(
        "a specimen that shows nothing of what the skin remembers is left out at once",
        (f"{SEARCH}.selection._Search._where_readings_remember",),
        lambda search, incumbent: incumbent,
    ),
    "drifts_again": Rule(
        "contacts that wander are reconsidered after every term",
        (f"{SEARCH}.selection._without_drifts",),
        lambda build, incumbent, fixed: (incumbent, fixed),
    ),
    "compatible_with_instrument": Rule(
        "beside an instrument's trial that doesn't hold nothing enters that gains less than half as much",
        (f"{SEARCH}.selection.instrument_worth_a_name",),
        lambda problem, current, asked: None,
    ),
    "another_property": Rule(
        "of smooth fields of two properties that gain alike the one enters that predicts cells better",
        (f"{SEARCH}.entering._of_another_property",),
        lambda field, trial, gain: False,
    ),
    "lower_first": Rule(
        "a first name where little is missing needs to gain less",
        (f"{SEARCH}.trials.FIRST_SHARE",),
        1.0,
    ),
    "by_place": Rule(
        "a field is told place by place where it, or it and one term more, explain most of what is missing",
        (f"{SEARCH}.selection.with_field_by_place", f"{SEARCH}.selection.with_fields_by_place"),
        _not_by_place,
    ),
    "fields_again": Rule(
        "a field that entered while others were missing may give way to what explains as much beside them",
        (f"{SEARCH}.selection._Search._in_a_fields_place",),
        lambda search, incumbent, number: None,
    ),
    "behind_fields": Rule(
        "what a smooth field stands in for is asked for by evidence",
        (f"{SEARCH}.selection.behind_field",),
        lambda problem, solved, number: [],
    ),
    "other_forms": Rule(
        "forms that gained nearly as much as one that entered, and effects before a field, are gone on with where a "
        "mismatch stays",
        (f"{SEARCH}.selection.other_forms",),
        lambda trial, trials, rivals, fixed: [],
    ),
    "memory_first": Rule(
        "what places keep of presses may enter in the stead of contacts that wander",
        (f"{SEARCH}.selection._Search._remembering",),
        lambda search, incumbent, start: None,
    ),
}


@contextmanager
def without(rule: str | None) -> Iterator[None]:
    """The diagnosis with one rule switched off; as it is for None."""
    switched = [] if rule is None else [patch(place, RULES[rule].instead) for place in RULES[rule].where]
    for one in switched:
        one.start()
    try:
        yield
    finally:
        for one in switched:
            one.stop()


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """The diagnosis with all rules; how often each that is a function said other than what takes its place."""
    acted: Counter[str] = Counter()

    def watched(name: str, rule: Callable[..., Any], instead: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(rule)
        def asked(*given: Any, **named: Any) -> Any:
            said = rule(*given, **named)
            acted[name] += not _same(said, instead(*given, **named))
            return said

        return asked

    with ExitStack() as switched:
        for name, rule in RULES.items():
            if callable(rule.instead):
                acted[name] = 0
                for place in rule.where:
                    switched.enter_context(patch(place, watched(name, resolve_name(place), rule.instead)))
        yield acted


def _same(said: Any, instead: Any) -> bool:
    """Whether a rule said what takes its place says: the same objects, fits of the same numbers, equal plain values."""
    if isinstance(said, tuple | list) and isinstance(instead, tuple | list):
        return len(said) == len(instead) and all(map(_same, said, instead))
    if isinstance(said, FormError):
        return said.sizes is None
    if isinstance(said, CheckedFit) and isinstance(instead, CheckedFit):
        return said.problem is instead.problem and said.solved is instead.solved
    return said is instead or (isinstance(said, bool | float | np.bool_) and bool(said == instead))


def answer(recording: Path, rule: str | None, out: Path) -> dict[str, Any]:
    """What a diagnosis without the rule says, made once; with ``cpu_s``, what it took.

    With all rules also ``acted``, how often each did. Without one that never did nothing is run: the answer is that
    with all, but for steps that the rule took in vain, and its time isn't known (``cpu_s`` None).
    """
    file = out / (rule or "all") / recording.stem / "diagnosis.json"
    if not file.is_file():
        with_all = answer(recording, None, out) if rule is not None else {}
        idle = with_all.get("acted", {}).get(rule) == 0
        said = {**with_all, "cpu_s": None} if idle else _diagnosed(recording, rule)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(finite(said), indent=1))
    return dict(json.loads(file.read_text(encoding="utf-8")))


def _diagnosed(recording: Path, rule: str | None) -> dict[str, Any]:
    """A recording's diagnosis without the rule, run."""
    with counted() if rule is None else without(rule) as acted:
        begun = process_time()
        found = diagnose(read_recording(recording), str(recording), lambda share, text: None)
        said = {**found.diagnosis.as_builtins(), "cpu_s": process_time() - begun}
    return said if acted is None else {**said, "acted": dict(acted)}


@dataclass(frozen=True)
class Count:
    """Over recordings: hidden names in all, named rightly and wrongly at 0.5 or more, and what is left held out."""

    hidden: int
    right: int
    wrong: int
    surely_wrong: int
    ratios: tuple[float, ...]
    cpu_s: float | None

    @classmethod
    def of(cls, cases: Sequence[Judged]) -> Count:
        """Of recordings opened."""
        claims = [(case, claim) for case in cases for claim in case.likely]
        wrong = [claim for case, claim in claims if not case.is_right(claim)]
        took = [case.diagnosis["cpu_s"] for case in cases]
        return cls(
            sum(len(case.hidden) for case in cases),
            len({(case.name, claim["name"]) for case, claim in claims if case.is_right(claim)}),
            len(wrong),
            sum(claim["confidence"] >= CONFIDENT for claim in wrong),
            tuple(float(case.diagnosis["held_out"]["ratio_after"] or np.nan) for case in cases),
            None if None in took else float(sum(took)),
        )

    def row(self, name: str) -> str:
        """A line of the table."""
        left = ", ".join(f"{ratio:.3f}" for ratio in self.ratios)
        wrong = f"{self.wrong} ({self.surely_wrong})"
        cpu = "" if self.cpu_s is None else f"{self.cpu_s:.0f}"
        return f"| {name} | {self.right} of {self.hidden} | {wrong} | {left} | {cpu} |"


def opened(out: Path, truths: Path, recordings: Sequence[Path], rule: str | None) -> list[Judged] | None:
    """The recordings as diagnosed without a rule, beside their truths; None until all are."""
    files = [out / (rule or "all") / recording.stem / "diagnosis.json" for recording in recordings]
    if not all(file.is_file() for file in files):
        return None
    found = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    hidden = [json.loads((truths / f"{r.stem}.json").read_text(encoding="utf-8"))["truth"] for r in recordings]
    return [Judged(r.stem, truth, said) for r, truth, said in zip(recordings, hidden, found, strict=True)]


def table(out: Path, truths: Path, recordings: Sequence[Path], rules: Sequence[str]) -> str:
    """Every rule's line, as far as its recordings are all there."""
    lines = [
        f"| switched off | named at {LIKELY} | wrong names at {LIKELY} ({CONFIDENT}) | left held out | CPU s |",
        "| --- | --- | --- | --- | --- |",
    ]
    for rule in (None, *rules):
        cases = opened(out, truths, recordings, rule)
        if cases is not None:
            name = "nothing" if rule is None else f"`{rule}`: {RULES[rule].about}"
            lines.append(Count.of(cases).row(name))
    return "\n".join(lines) + "\n"


def of_reasons(cases: Sequence[Judged]) -> str:
    """What each rule that lowers a confidence took from right and wrong names, by the claims' own reasons."""
    lines = ["| rule | right names lowered | below 0.5 | wrong names lowered | below 0.5 |", "| --- " * 5 + "|"]
    by_rule: dict[str, list[tuple[bool, bool]]] = {}
    for case in cases:
        for claim in case.claims:
            for reason in claim.get("reasons", ()):
                if reason["rule"] != "rivals":
                    lost = reason["before"] >= LIKELY > reason["after"]
                    by_rule.setdefault(reason["rule"], []).append((case.is_right(claim), lost))
    for rule, found in sorted(by_rule.items()):
        cells = [
            str(value)
            for right in (True, False)
            for value in (sum(r is right for r, _ in found), sum(r is right and lost for r, lost in found))
        ]
        lines.append(f"| `{rule}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def of_acting(out: Path, recordings: Sequence[Path]) -> str:
    """How often each rule acted where all of them are in force, and in how many of the recordings."""
    lines = ["| rule | acted | in recordings |", "| --- " * 3 + "|"]
    acted = [answer(recording, None, out).get("acted", {}) for recording in recordings]
    for rule in RULES:
        counts = [one[rule] for one in acted if rule in one]
        if counts:
            lines.append(f"| `{rule}` | {sum(counts)} | {sum(map(bool, counts))} of {len(counts)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder for answers and tables")
    parser.add_argument("truths", type=Path, help="folder of truths, NAME.json")
    parser.add_argument("recordings", type=Path, nargs="+", help="NAME.h5")
    parser.add_argument(
        "--rules", nargs="*", choices=[*RULES], default=[*RULES], help="which to switch off, one by one"
    )
    options = parser.parse_args()
    for rule in (None, *options.rules):
        for recording in options.recordings:
            answer(recording, rule, options.out)
        text = table(options.out, options.truths, options.recordings, options.rules)
        cases = opened(options.out, options.truths, options.recordings, None)
        acting = of_acting(options.out, options.recordings)
        write_whole(options.out / "ablation.md", "\n".join((text, of_reasons(cases or []), acting)))
        print(text, flush=True)


if __name__ == "__main__":
    main()

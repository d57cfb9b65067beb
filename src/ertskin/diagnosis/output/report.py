"""report.html: what was found, what to do next, and figures before and after, on a page of the reports' look."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, gathered
from ertskin.diagnosis.judge.axis_tests import AxisTest
from ertskin.diagnosis.judge.result import Findings
from ertskin.diagnosis.output.figures import Drawn
from ertskin.diagnosis.output.summary import how_sure, in_words
from ertskin.report.figures.image import data_uri
from ertskin.report.page import Page, Picture, Row, Section, Table, write_page
from ertskin.report.words import chance_in_words, force_in_words, interval, words_of

MEANING = {
    "no_mismatch": "The simulator explains the recording to within the noise: nothing is missing.",
    "explained": "The simulator lacks the physics named below; with it, the recording is explained.",
    "partly_explained": (
        "The simulator lacks the physics named below, and something else that is not named, or a map that isn't known."
    ),
    "unexplained": "The simulator misses something, and no effect is named for it.",
    "cannot_tell": "The recording can't answer.",
}


def write_report(
    folder: Path, findings: Findings, drawn: Sequence[Drawn], commands: Sequence[str] = (), footer: Sequence[str] = ()
) -> Path:
    """``folder/report.html`` with the figures ``drawn`` into the folder.

    ``commands`` are what to do next, ``footer`` how the numbers came about.
    """
    return write_page(folder / "report.html", _page(findings, drawn, commands, footer))


def _page(findings: Findings, drawn: Sequence[Drawn], commands: Sequence[str], footer: Sequence[str]) -> Page:
    diagnosis = findings.diagnosis
    sections = [_missing(diagnosis.claims)] if diagnosis.claims else []
    if commands:
        sections.append(Section("What to do next", commands=tuple(commands)))
    sections += [section for section in (_misfit(diagnosis), _tests(findings)) if section is not None]
    sections += [
        Section(one.title, pictures=(Picture(data_uri(one.path.read_bytes()), one.caption, wide=True),))
        for one in drawn
    ]
    summary = MEANING[diagnosis.verdict] + (f" {diagnosis.reason}." if diagnosis.reason else "")
    title = f"Diagnosis of {diagnosis.recording}: {words_of(diagnosis.verdict)}"
    return Page(title, summary, _key_numbers(diagnosis), tuple(sections), tuple(footer))


def _key_numbers(diagnosis: Diagnosis) -> tuple[tuple[str, str], ...]:
    held = diagnosis.held_out
    numbers = []
    if held.ratio_before is not None:
        numbers.append((f"{held.ratio_before:.2f}", "misfit over noise before"))
    if held.ratio_after is not None and diagnosis.claims:
        numbers.append((f"{held.ratio_after:.2f}", "misfit over noise after"))
    if held.force_before_n is not None and held.force_after_n is not None:
        before, after = force_in_words(held.force_before_n), force_in_words(held.force_after_n)
        numbers.append((before, "force misfit (rms)" if before == after else "force misfit (rms) before"))
        if before != after:
            numbers.append((after, "force misfit (rms) after"))
    return tuple(numbers)


def _missing(claims: tuple[Claim, ...]) -> Section:
    rows = []
    for claim, name in gathered(claims):
        values = "\n".join(
            f"{words_of(key)} {interval(e.value, e.low, e.high, e.unit)}" for key, e in claim.shown.items()
        )
        rivals = ", ".join(f"{words_of(n)} ({c:.2f})" for n, c in claim.alternatives) or "none"
        rows.append(
            Row(
                (
                    (words_of(name), claim.effect.stage),
                    (how_sure(claim), ""),
                    (f"{claim.ratio_alone:.3g}", ""),
                    ("", values),
                    ("", rivals),
                )
            )
        )
    heads = ("effect", "confidence", "misfit it makes", "parameters, 90 % interval", "what else it could be")
    about = "Misfit it makes: what the effect alone would leave on held-out presses, over the noise."
    words = tuple(f"{words_of(c.effect.name).capitalize()}: {_about(c)}" for c, _ in gathered(claims))
    return Section("What is missing", words, tables=(Table(heads, tuple(rows), about),))


def _about(claim: Claim) -> str:
    """What the effect is in plain words, then its form and what that rests on."""
    kind = type(claim.effect)
    summary = (sys.modules[kind.__module__].__doc__ or "").splitlines()[0]
    paragraph = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
    form = paragraph.split(". ")[0].replace("``", "").rstrip(".")
    return f"{summary} {form} ({claim.effect.source})."


def _misfit(diagnosis: Diagnosis) -> Section | None:
    held = diagnosis.held_out
    if held.ratio_before is None:
        return None
    facts = [("held out", held.split), ("misfit over noise before", f"{held.ratio_before:.3f}")]
    if held.ratio_after is not None:
        facts.append(("misfit over noise after", f"{held.ratio_after:.3f}"))
    if held.noise_rms_v is not None:
        facts.append(("noise of a reading", f"{1e3 * held.noise_rms_v:.3g} mV"))
    if diagnosis.remainder_ratio is not None:
        facts.append(("after, with a nameless model of what stays", f"{diagnosis.remainder_ratio:.3f}"))
    if diagnosis.presses_differ is not None:
        facts.append(("what is left", in_words(diagnosis.presses_differ)))
    return Section("How far model and recording are apart", facts=tuple(facts))


def _tests(findings: Findings) -> Section | None:
    tables = []
    for when, tests in (("before", findings.tests_before), ("after", findings.tests_after)):
        rows = tuple(_test_row(test) for test in tests if test.ratio)
        if rows:
            heads = (f"along, {when}", "misfit over noise", "most at", "p, corrected")
            tables.append(Table(heads, rows))
    return Section("Where the misfit sits", tables=tuple(tables)) if tables else None


def _test_row(test: AxisTest) -> Row:
    worst = int(np.argmax(test.ratio))
    spread = f"{min(test.ratio):.2f} to {max(test.ratio):.2f}"
    return Row(((words_of(test.axis), ""), (spread, ""), (test.label[worst], ""), (chance_in_words(test.p_value), "")))

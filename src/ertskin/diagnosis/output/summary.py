"""A diagnosis in a few lines on the terminal."""

from __future__ import annotations

from rich.console import Console

from ertskin.diagnosis.contract.claims import Claim, Diagnosis, gathered
from ertskin.diagnosis.judge.repeatability import Repeatability
from ertskin.report.words import confidence_in_words, force_in_words
from ertskin.terminal_table import Column, Row, print_table


def how_sure(claim: Claim) -> str:
    """How sure a claim is, in words."""
    return confidence_in_words(claim.named, claim.right, claim.right_everywhere)


def print_summary(console: Console, diagnosis: Diagnosis) -> None:
    """Verdict, misfit before and after, and the effects with their parameters."""
    held = diagnosis.held_out
    console.print(f"[bold]{diagnosis.verdict}[/bold]" + (f": {diagnosis.reason}" if diagnosis.reason else ""))
    if held.ratio_before is not None:
        after = f", with the effects below {held.ratio_after:.3f}" if diagnosis.claims else ""
        console.print(
            f"misfit on presses held out, in units of the noise: {held.ratio_before:.3f}{after}", highlight=False
        )
    if held.force_before_n is not None and held.force_after_n is not None and diagnosis.claims:
        console.print(
            f"misfit of the force (rms): {force_in_words(held.force_before_n)} before,"
            f" {force_in_words(held.force_after_n)} after",
            highlight=False,
        )
    if diagnosis.presses_differ is not None:
        console.print(in_words(diagnosis.presses_differ), highlight=False)
    if not diagnosis.claims:
        return
    rows = []
    for claim, name in gathered(diagnosis.claims):
        words = "\n".join(
            f"{k} {e.value:.4g} [{e.low:.4g}, {e.high:.4g}]{of_unit(e.unit)}" for k, e in claim.shown.items()
        )
        rows.append(Row((name, how_sure(claim), f"{claim.ratio_alone:.3g}", words)))
    heads = Column("effect", words=True), Column("confidence"), Column("misfit\nit makes")
    print_table(console, (*heads, Column("parameters (90 %)", words=True)), rows)


def of_unit(unit: str) -> str:
    """A unit to stand after a number; a mere number has none."""
    return "" if unit == "1" else f" {unit}"


def in_words(presses: Repeatability) -> str:
    """What presses that differ mean."""
    return (
        f"presses don't repeat: most of what is left is as if each landed {1e3 * presses.landing_m:.2g} mm off along"
        f" either axis and pressed {presses.strength:.0%} harder or softer (rms), which would leave {presses.ratio:.3f}"
    )


def print_retrained(console: Console, retrained: dict[str, dict[str, dict[str, float]]]) -> None:
    """Every metric of every network, trained without and with the effects."""
    heads = Column("network", words=True), Column("metric", words=True)
    numbers = (Column(f"trained {name}\nthe effects") for name in retrained)
    first = next(iter(retrained.values()))
    rows = [
        Row((model, metric, *(f"{found[model][metric]:.4g}" for found in retrained.values())))
        for model, metrics in first.items()
        for metric in metrics
    ]
    print_table(console, (*heads, *numbers), rows)

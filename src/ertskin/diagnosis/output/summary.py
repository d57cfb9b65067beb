"""A diagnosis in a few lines on the terminal."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from ertskin.diagnosis.contract.claims import Diagnosis, gathered
from ertskin.diagnosis.judge.repeatability import Repeatability


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
            f"force: {held.force_before_n:.3g} N off before, {held.force_after_n:.3g} N after", highlight=False
        )
    if diagnosis.presses_differ is not None:
        console.print(in_words(diagnosis.presses_differ), highlight=False)
    if not diagnosis.claims:
        return
    table = Table(box=box.SIMPLE_HEAD)
    for head in ("effect", "confidence", "misfit it makes", "parameters (90 %)"):
        table.add_column(head, overflow="fold")
    for claim, name in gathered(diagnosis.claims):
        words = "\n".join(
            f"{k} {e.value:.4g} [{e.low:.4g}, {e.high:.4g}]{of_unit(e.unit)}" for k, e in claim.parameters.items()
        )
        table.add_row(name, f"{claim.confidence:.2f}", f"{claim.ratio_alone:.3g}", words)
    console.print(table)


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
    table = Table("network", "metric", *(f"trained {name} the effects" for name in retrained))
    first = next(iter(retrained.values()))
    for model, metrics in first.items():
        for metric in metrics:
            table.add_row(model, metric, *(f"{found[model][metric]:.4g}" for found in retrained.values()))
    console.print(table)

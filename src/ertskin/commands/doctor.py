"""Say whether a recording is sound, and which instruments answer.

``recording=FILE`` prints what the file holds and what is wrong with it; ``rig=NAME`` asks every instrument of the rig.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hardware.measurement import RecordingError
from hardware.validate import Findings, validate

if TYPE_CHECKING:
    from omegaconf import DictConfig
    from rich.console import Console


def run(config: DictConfig) -> None:
    """Examine ``config.recording`` and print what was found; raises ``RecordingError`` where it can't be used."""
    from rich.console import Console

    examine_recording(Path(config.recording), Console())


def examine_recording(path: Path, console: Console) -> None:
    """Print what the recording at ``path`` holds and what is wrong with it; raises ``RecordingError`` if unusable."""
    findings = validate(path)
    if findings.errors:
        raise RecordingError(findings.errors[0])
    print_findings(findings, console)


def print_findings(findings: Findings, console: Console) -> None:
    """Print the facts as a table, then the warnings, a line each."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(str(findings.path)), show_header=False, title_justify="left")
    for fact in findings.facts:
        table.add_row(fact.name, escape(fact.value))
    console.print(table)
    for warning in findings.warnings:
        console.print(f"[yellow]warning[/yellow] {escape(warning)}", soft_wrap=True, highlight=False)
    console.print("[green]ok[/green] the recording can be used", highlight=False)

"""Say whether a recording is sound, and which instruments answer.

``recording=FILE`` prints what the file holds and what is wrong with it, and with ``sealed=FOLDER`` what a virtual
bench hid in its skin; ``rig=NAME`` asks every instrument of the rig, without moving anything; with neither, every
serial port of this machine is asked what it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ertskin.hardware.measurement import RecordingError
from ertskin.hardware.validate import Findings, validate

if TYPE_CHECKING:
    from omegaconf import DictConfig
    from rich.console import Console
    from rich.table import Table

    from ertskin.hardware.discovery import Answer
    from ertskin.hardware.uses import Use


def run(config: DictConfig) -> None:
    """Examine ``config.recording``, or ask ``config.rig``, or ask every port."""
    from rich.console import Console

    console = Console()
    if config.recording is not None:
        examine_recording(Path(config.recording), console)
        if config.sealed is not None:
            open_seal(Path(config.recording), Path(config.sealed), console)
    if config.get("rig") is not None:
        examine_rig(config, console)
    elif config.recording is None:
        examine_ports(console)


def examine_recording(path: Path, console: Console, called: Path | None = None) -> None:
    """Print what the recording at ``path`` holds and what is wrong with it; raises ``RecordingError`` if unusable.

    ``called``: the name it is going to have.
    """
    findings = validate(path)
    if findings.errors:
        raise RecordingError(findings.errors[0])
    findings.path = called or path
    print_findings(findings, console)


def open_seal(path: Path, folder: Path, console: Console) -> None:
    """Print what was hidden in the skin of a virtual bench's recording; raises ``UserError`` where there is no seal."""
    from ertskin.errors import UserError
    from ertskin.hardware.virtual.bench.sealing import SealError, unseal

    try:
        truth, _ = unseal(path, folder)
    except SealError as error:
        raise UserError(str(error)) from None
    console.print(f"hidden in the skin of seed {truth.seed}:", highlight=False)
    for name, hidden in truth.effects.items():
        console.print(f"  {name}: {hidden['parameters']}", highlight=False, soft_wrap=True)


def print_findings(findings: Findings, console: Console) -> None:
    """Print the facts as a table, what the recording can be used for as another, then the warnings, a line each."""
    from rich.markup import escape
    from rich.table import Table

    console.print(str(findings.path), soft_wrap=True, highlight=False, markup=False)
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for fact in findings.facts:
        table.add_row(fact.name, escape(fact.value))
    console.print(table)
    console.print(_uses_table(findings.uses))
    for warning in findings.warnings:
        console.print(f"[yellow]warning[/yellow] {escape(warning)}", soft_wrap=True, highlight=False)
    if any(use.able for use in findings.uses):
        console.print("[green]ok[/green] the recording can be used", highlight=False)


def _uses_table(uses: list[Use]) -> Table:
    """Use, yes or no, and why."""
    from rich.markup import escape
    from rich.table import Table

    table = Table()
    table.add_column("can be used to", no_wrap=True)
    table.add_column("", no_wrap=True)
    table.add_column("because", overflow="fold")
    for use in uses:
        table.add_row(use.name, "[green]yes[/green]" if use.able else "[red]no[/red]", escape(use.because))
    return table


def examine_rig(config: DictConfig, console: Console) -> None:
    """Ask every instrument of the configured rig; raises ``JobFailed`` where one does not answer."""
    from omegaconf import OmegaConf

    from ertskin.bench.opening import described, ports
    from ertskin.errors import JobFailed, UserError
    from ertskin.hardware.discovery import ask_rig
    from ertskin.hardware.rig import RigError

    fields = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    try:
        sensor, protocol = described(fields["sensor"])
        with ports(fields["rig"], sensor, protocol) as (rig, clock):
            answers = ask_rig(rig, protocol, clock)
    except RigError as error:
        raise UserError(str(error)) from None
    _print_answers(answers, console)
    if silent := [answer.where for answer in answers if not answer.well]:
        raise JobFailed(f"rig {fields['rig']['name']}: no answer from {', '.join(silent)}")


def examine_ports(console: Console) -> None:
    """Ask every serial port of this machine what it is."""
    from ertskin.hardware.clock import SystemClock
    from ertskin.hardware.discovery import discover, ports

    found = ports()
    if not found:
        console.print("no serial ports; recording=FILE examines a recording, rig=virtual the virtual bench")
        return
    for name, known in found:
        console.print(f"{name}  {known}", highlight=False, soft_wrap=True)
    _print_answers(discover([name for name, _ in found], SystemClock()), console)


def _print_answers(answers: list[Answer], console: Console) -> None:
    from rich.markup import escape

    for answer in answers:
        mark = "[green]ok[/green]" if answer.well else "[red]--[/red]"
        console.print(f"{mark} {escape(answer.where)}: {escape(answer.what)}", highlight=False, soft_wrap=True)

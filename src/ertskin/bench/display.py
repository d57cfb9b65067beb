"""What a person sees of a recording: the plan before it, and how it goes while it does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from ertskin.hardware.plan import Plan, Press
from ertskin.physics.history import Phase

if TYPE_CHECKING:
    from rich.console import Console

    from ertskin.hardware.experiment import Progress as RecordingProgress


def print_plan(console: Console, plan: Plan) -> None:
    """The plan and how long it takes, without moving anything."""
    table = Table(title=f"plan {plan.name}", title_justify="left")
    for heading in ("presses", "place (mm)", "deepest (mm)", "frames a press", "phases"):
        table.add_column(heading)
    for numbers, press in _runs(plan):
        places = "  ".join(f"({1e3 * x:.1f}, {1e3 * y:.1f})" for x, y in press.contact_m)
        depth = f"{1e3 * press.depth_m:.2f}" if press.weight_n is None else f"weights of {press.weight_n:.2f} N"
        phases = Counter({Phase.REST: press.rest_frames})
        for step in press.steps:
            phases[step.phase] += step.frames
        by_phase = ", ".join(f"{count} {phase.name.lower()}" for phase, count in phases.items() if count)
        table.add_row(numbers, places, depth, str(press.frames), by_phase)
    console.print(table)
    seconds = plan.duration_s()
    took = f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
    console.print(f"{len(plan.presses)} presses, {plan.frames} frames, about {took}", highlight=False)


def _runs(plan: Plan) -> list[tuple[str, Press]]:
    """Presses with their numbers; repeats of one press in a row share a line."""
    runs: list[tuple[int, int, Press]] = []
    for number, press in enumerate(plan.presses):
        if runs and runs[-1][2] == press:
            runs[-1] = (runs[-1][0], number, press)
        else:
            runs.append((number, number, press))
    return [(str(a) if a == b else f"{a} to {b}", press) for a, b, press in runs]


LINES = 6
"""Lines of progress where there is no terminal."""


class Display:
    """A progress bar on a terminal; a few lines elsewhere."""

    def __init__(self, console: Console, plan: Plan, done: int = 0, before: int = 0) -> None:
        """``done``: frames there are already, ``before`` of them of presses that the plan adds to."""
        self._console = console
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("getting ready", total=before + plan.frames, completed=done)
        self._name = plan.name
        self._press = -1

    def __enter__(self) -> Display:
        self._bar.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._bar.stop()

    def stepping_aside(self, ask: Callable[[Press | None], None]) -> Callable[[Press | None], None]:
        """The same call, with no bar drawn over what it says."""

        def asked(press: Press | None) -> None:
            self._bar.stop()
            ask(press)
            self._bar.start()

        return asked

    def show(self, progress: RecordingProgress) -> None:
        """Take notice of a frame."""
        sound = progress.soundness
        noise = f"{1e3 * sound.noise_v:.2f}" if sound.noise_v > 0 else "-"
        checks = f"noise {noise} mV, reciprocity {100 * sound.reciprocity_defect:.2g} %"
        if sound.saturated:
            checks += f", [red]{100 * sound.saturated:.2g} % saturated[/red]"
        depth = "-" if progress.depth_m != progress.depth_m else f"{1e3 * progress.depth_m:.1f} mm"
        text = f"press {min(progress.press + 1, progress.presses)}/{progress.presses} {progress.phase.name.lower()} "
        text += f"{depth} {progress.force_n:.2f} N · {checks}"
        self._bar.update(self._task, completed=progress.frame, description=text)
        begun = progress.press != self._press and progress.press < progress.presses
        if begun and not self._console.is_terminal and progress.press % max(1, progress.presses // LINES) == 0:
            self._console.print(
                f"{self._name}: press {progress.press + 1}/{progress.presses}  frame {progress.frame}  {checks}",
                highlight=False,
                soft_wrap=True,
            )
        self._press = progress.press

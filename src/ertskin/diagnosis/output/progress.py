"""Progress of a diagnosis on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


@contextmanager
def progress_bar(console: Console) -> Iterator[Callable[[float | None, str], None]]:
    """A bar that a diagnosis moves by calling it with the part done (None: as before) and what it does now."""
    columns = (
        BarColumn(),
        TextColumn("{task.percentage:3.0f}%"),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)

        def report(share: float | None, text: str) -> None:
            bar.update(task, description=text, **({} if share is None else {"completed": share}))  # type: ignore[arg-type]

        yield report

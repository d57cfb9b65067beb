"""Test trained networks beside the yardsticks, and write the report.

``one=FILE``, ``two=FILE`` and ``anywhere=FILE`` are test recordings of single presses, of two weights and of contacts
anywhere, of which one is enough. Every metric goes to a table on the terminal, to evaluation.json and .csv, to MLflow,
and to report.html.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig


def run(config: DictConfig) -> None:
    """Evaluate, and print the table and where the report is."""
    from ertskin.evaluation.recordings import evaluated_recordings

    files = evaluated_recordings(config)  # Refused before what follows loads for seconds.

    from rich.console import Console

    from ertskin.progress import saying

    console = Console()
    with saying("evaluating") as say:
        say("loading")
        from ertskin.evaluation.evaluate import evaluate
        from ertskin.evaluation.summary import print_table

        done = evaluate(config, files, say)
    print_table(console, done.methods)
    for line in done.remarks:
        console.print(line, soft_wrap=True, highlight=False)
    console.print(f"report: {done.report}", soft_wrap=True, highlight=False)

"""Ten thousand faults across all drivers: ``python experiments/bench/faults.py [FAULTS] [SEED]``; writes faults.md."""

from __future__ import annotations

import sys
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np

from ertskin.hardware.virtual.fault_trial import (
    LOAD_CELLS,
    READERS,
    STAGES,
    Tally,
    try_experiment,
    try_load_cell,
    try_reader,
    try_stage,
)

BENCHES = (
    ("grbl", "hx711", "link"),
    ("marlin", "mark10", "link"),
    ("grbl", "futek", "eit_kit"),
    ("marlin", "hx711", "spectra"),
)
COLUMNS = ("faults", "handed_out", "reported", "wrong", "unreported_lost", "left_pressing", "overdue")


def main(faults: int = 10_000, seed: int = 20) -> None:
    """Eight tenths on the drivers one by one, the rest in whole experiments."""
    begin = time.process_time()
    each = faults * 8 // 10 // 8
    trials = [partial(try_reader, kind) for kind in READERS]
    trials += [partial(try_load_cell, kind) for kind in LOAD_CELLS]
    trials += [partial(try_stage, kind) for kind in STAGES]
    seeds = np.random.SeedSequence(seed).generate_state(len(trials) + faults)
    tallies = [trial(each, int(number)) for trial, number in zip(trials, seeds, strict=False)]
    done = sum(tally.faults for tally in tallies)
    experiments: list[Tally] = []
    while done + sum(tally.faults for tally in experiments) < faults:
        number = len(experiments)
        experiments.append(try_experiment(*BENCHES[number % len(BENCHES)], int(seeds[len(trials) + number]), 0.02))
    write(tallies, experiments, seed, time.process_time() - begin)


def write(tallies: list[Tally], experiments: list[Tally], seed: int, took_s: float) -> None:
    """The table, beside this file."""
    rows = [_row(tally.subject, [tally]) for tally in tallies]
    rows.append(_row(f"{len(experiments)} whole experiments", experiments))
    rows.append(_row("all", tallies + experiments))
    kinds = sum((tally.injected for tally in tallies + experiments), Counter())
    text = [
        f"Seed {seed}, {took_s:.0f} s of processor time. `handed out`: scans, frames' forces, arrivals or frames;",
        "`reported`: calls that said so; `longest`: the longest call, in seconds of the bench's clock.",
        "",
        "| subject | "
        + " | ".join(name.replace("_", " ") for name in COLUMNS)
        + " | escaped exceptions | longest (s) |",
        "| --- |" + " --- |" * (len(COLUMNS) + 2),
        *rows,
        "",
        "Faults by kind: " + ", ".join(f"{kind} {count}" for kind, count in _by_kind(kinds).most_common()) + ".",
        "",
    ]
    Path(__file__).with_name("faults.md").write_text("\n".join(text))
    print("\n".join(text))


def _row(subject: str, tallies: list[Tally]) -> str:
    numbers = [str(sum(getattr(tally, name) for tally in tallies)) for name in COLUMNS]
    escaped = sum(tally.escaped.total() for tally in tallies)
    longest = max(tally.longest_s for tally in tallies)
    return f"| {subject} | {' | '.join(numbers)} | {escaped} | {longest:.1f} |"


def _by_kind(kinds: Counter[str]) -> Counter[str]:
    """Without saying whose line it was."""
    found: Counter[str] = Counter()
    for kind, count in kinds.items():
        found[kind.split(" ", 1)[1] if " to the " in kind else kind] += count
    return found


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:3]))

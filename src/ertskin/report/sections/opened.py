"""What was hidden in a virtual skin: its seal, opened after everything else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ertskin.report.page import Row, Section, Table
from ertskin.report.words import words_of


def opened(hidden: Mapping[str, Mapping[str, Any]], named: tuple[str, ...] | None, commitment: str) -> Section:
    """``hidden``: parameters by effect. ``named``: what a diagnosis had said before, None where there was none."""
    words = (
        "Truth and recording were written together; the truth went into another folder, its checksum beside the "
        f"recording. Opened now, it is the one committed to: {commitment[:16]}….",
        _judged(set(hidden), named),
    )
    rows = tuple(
        Row(((words_of(name), ""), ("", "\n".join(f"{words_of(key)}: {_value(v)}" for key, v in parameters.items()))))
        for name, parameters in hidden.items()
    )
    tables = (Table(("hidden", "parameters in the bench's own form"), rows),) if rows else ()
    return Section("What was hidden", words, tables=tables)


def _judged(hidden: set[str], named: tuple[str, ...] | None) -> str:
    if named is None:
        return "No diagnosis was made."
    parts = [
        (hidden & set(named), "Named and there"),
        (hidden - set(named), "Hidden and not named"),
        (set(named) - hidden, "Named and not there"),
    ]
    said = [f"{head}: {', '.join(words_of(name) for name in sorted(names))}." for names, head in parts if names]
    return " ".join(said) or "Nothing was hidden, and nothing was named."


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(_value(each) for each in value[:6]) + (", …" if len(value) > 6 else "")
    return f"{value:.4g}" if isinstance(value, float) else str(value)

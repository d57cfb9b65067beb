"""What the simulator lacks: the names a diagnosis gave, how sure it is and why, from the files it left."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ertskin.report.figures.image import data_uri
from ertskin.report.page import Picture, Row, Section, Table
from ertskin.report.words import confidence_in_words, interval, words_of

TITLE = "What the simulator lacked, and how that was told"
SHOWN = (
    "What was found over the sheet",
    "Misfit over the sheet",
    "Misfit against force",
    "Misfit by electrode",
    "Force against depth",
)
"""Figures of a diagnosis that are shown, where it drew them; its own page has them all."""
MEANING = {
    "no_mismatch": "Nothing: the simulator explains presses that no fit has seen to within the noise.",
    "explained": "The physics below; with it presses that no fit has seen are explained.",
    "partly_explained": "The physics below, and something else that is not named, or a map that isn't known.",
    "unexplained": "Something for which no effect is named.",
    "cannot_tell": "The recording can't tell.",
}


def lacking(folder: Path) -> Section:
    """The section from ``folder/diagnosis.json`` and the figures beside it."""
    found = _read(folder)
    words = [MEANING[found["verdict"]] + (f" {found['reason']}." if found.get("reason") else "")]
    words += [f"{words_of(effect['name']).capitalize()}: {_explained(effect)}." for effect in found["effects"]]
    tables = (_named(found["effects"]),) if found["effects"] else ()
    return Section(TITLE, tuple(words), _facts(found), tables=tables, pictures=tuple(_pictures(folder, found)))


def named_in(folder: Path) -> tuple[str, ...]:
    """The names given in ``folder/diagnosis.json``."""
    return tuple(effect["name"] for effect in _read(folder)["effects"])


def _read(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "diagnosis.json").read_text(encoding="utf-8")))


def _facts(found: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    held, where = found["held_out"], found["where"]
    facts = [("verdict", words_of(found["verdict"])), ("held out", held["split"])]
    for key, when in (("ratio_before", "before"), ("ratio_after", "with the effects")):
        if held[key] is not None and (key == "ratio_before" or found["effects"]):
            facts.append((f"misfit over noise, {when}", f"{held[key]:.3f}"))
    if where["depends_on"]:
        facts.append(("the misfit goes with", ", ".join(map(words_of, where["depends_on"]))))
    return tuple(facts)


def _explained(effect: dict[str, Any]) -> str:
    """Why a name is as sure as it is, in the order of the rules."""
    reasons = [f"{reason['why']} ({reason['after']:.2f})" for reason in effect["reasons"]]
    return "; ".join(reasons) if reasons else f"confidence {effect['confidence']:.2f}"


def _how_sure(effect: dict[str, Any]) -> str:
    """How sure name and map are; a diagnosis of before has fewer numbers."""
    both = effect["confidence"]
    return confidence_in_words(effect.get("name_confidence", both), both, effect.get("confidence_everywhere", both))


def _named(effects: list[dict[str, Any]]) -> Table:
    rows = []
    for effect in effects:
        shown = {key: e for key, e in effect["parameters"].items() if "[" not in key} or effect["quantities"]
        values = [f"{words_of(key)} {interval(e['value'], e['low'], e['high'], e['unit'])}" for key, e in shown.items()]
        rivals = [f"{words_of(other['name'])} ({other['confidence']:.2f})" for other in effect["alternatives"]]
        rows.append(
            Row(
                (
                    (words_of(effect["name"]), ""),
                    (_how_sure(effect), ""),
                    (f"{effect['ratio_alone']:.3g}", ""),
                    ("", "\n".join(values)),
                    ("", ", ".join(rivals) or "none"),
                )
            )
        )
    heads = ("effect", "confidence", "misfit it makes", "parameters, 90 % interval", "what else it could be")
    return Table(
        heads, tuple(rows), "Misfit it makes: what the effect alone would leave on held-out presses, over the noise."
    )


def _pictures(folder: Path, found: dict[str, Any]) -> list[Picture]:
    return [
        Picture(data_uri((folder / drawn["file"]).read_bytes()), drawn["caption"], wide=True)
        for drawn in found.get("figures", [])
        if drawn["title"] in SHOWN
    ]

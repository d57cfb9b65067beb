"""How well contacts anywhere on the sheet are found: tables by their number, and where the errors lie."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ertskin.evaluation.results import MethodResult, metric_names
from ertskin.report.figures.contact_errors import error_by_distance, error_by_force, place_error_map
from ertskin.report.method_table import anywhere_table
from ertskin.report.page import Picture, Section
from ertskin.report.units import CONTACTS


def anywhere(methods: Sequence[MethodResult], shown: MethodResult) -> Section | None:
    """The section, or None where nothing was touched between the taxels; pictures of ``shown``'s first seed."""
    names = metric_names(methods)
    tables = [anywhere_table(methods, count) for count in CONTACTS if f"count_rate_{count}" in names]
    if not tables:
        return None
    words = (
        "Contacts of any number at places no network was taught. Yardsticks learn from the same simulated trials; the "
        "oracle searches the calibrated physics without a network; the bound knows the number of contacts.",
        f"The pictures show {shown.name}, seed {shown.runs[0].seed}.",
    )
    return Section("Touched anywhere", words, tables=tuple(tables), pictures=tuple(_pictures(shown)))


def _pictures(shown: MethodResult) -> list[Picture]:
    outcome = shown.runs[0].contacts
    if outcome is None or not len(outcome.place_error_mm):
        return []
    pictures = [
        Picture.of(place_error_map(outcome), "Location error over the sheet."),
        Picture.of(error_by_force(outcome), "Errors against the true force.", wide=True),
    ]
    if np.any(outcome.true_count > 1):
        pictures.append(Picture.of(error_by_distance(outcome), "Errors against the distance of contacts."))
    return pictures

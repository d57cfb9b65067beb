"""The report: whole, self-contained, escaped, and true to the numbers it was given."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import report_examples as examples

from ertskin.calibration.drawing import FIGURES
from ertskin.evaluation.results import MethodResult, write_results
from ertskin.report.figures.image import save_png
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.method_table import method_table
from ertskin.report.page import Page, Section, render
from ertskin.report.report import ReportInputs, write_report
from ertskin.report.sections.failures import failures
from ertskin.report.sections.grids import grids

VOID = {"meta", "img", "link", "br"}


class Outline(HTMLParser):
    """Headings, addresses, and whether every element is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.addresses: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)


@pytest.fixture(scope="module")
def html(tmp_path_factory) -> str:
    figures = tmp_path_factory.mktemp("calibration")
    for name in FIGURES:
        save_png(taxel_map(examples.TAXEL_M, np.arange(36.0), f"{name} / 1"), figures / f"{name}.png")
    folder = tmp_path_factory.mktemp("report") / "deep"
    path = write_report(folder / "report.html", examples.inputs(figures))
    return path.read_text(encoding="utf-8")


def test_the_report_tells_its_story_in_order(html):
    outline = Outline()
    outline.feed(html)
    assert outline.open == []
    assert outline.headings == [
        "What was recorded",
        "How well the model fits",
        "How well the network does",
        "Where it fails",
    ]


def test_the_report_needs_nothing_outside_itself(html):
    outline = Outline()
    outline.feed(html)
    assert all(address.startswith(("data:image/png;base64,", "#")) for address in outline.addresses)
    assert "<script" not in html
    assert not re.search(r"url\(|@import|https?://", html)


def test_the_report_shows_every_figure_of_the_paper(html):
    for number in ("4", "6", "7", "8a", "8b", "8c", "10a", "10b", "11"):
        assert f"(Fig. {number})" in html


def test_the_table_has_the_papers_numbers_and_every_method():
    table = method_table(examples.methods())
    assert len({len(row.cells) for row in table.rows} | {len(table.heads)}) == 1
    paper = {head: cell for head, cell in zip(table.heads, table.rows[0].cells, strict=True)}
    assert paper["hit rate, one point / %"] == ("82.0", "± 12.0")
    assert paper["force RMSE, one point / N"] == ("0.51", "± 0.72")
    assert paper["force error per contact, two points / N"] == ("5.00", "± 2.20")
    assert [row.cells[0][0] for row in table.rows[1:]] == [method.name for method in examples.methods()]


def test_a_cell_is_the_mean_over_seeds_with_both_spreads():
    method = examples.methods()[1]
    column = method_table([method]).heads.index("force RMSE, one point / N")
    main, small = method_table([method]).rows[1].cells[column]
    values = method.values("force_rmse_one_n")
    assert main == f"{values.mean():.2f}"
    assert small.endswith(f"seeds {values.min():.2f} to {values.max():.2f}")
    spreads = np.mean([run.scores["force_rmse_one_n"].taxel_spread for run in method.runs])
    assert f"± {spreads:.2f}\n" in small


def test_a_bound_leaves_dashes():
    row = method_table(examples.methods()).rows[-1]
    assert [main for main, _ in row.cells].count("–") == 5
    assert ("0.04", "0.04 ± 0.00") in row.cells


def test_failures_list_the_frames_that_are_wrong():
    method = examples.methods()[1]
    outcome = method.runs[0].outcome
    wrong = int((~(outcome.present == outcome.touched).all(axis=1)).sum())
    section = failures([method], method)
    assert f"in {wrong} of 302 frames" in section.words[0]
    assert 0 < len(section.tables[0].rows) <= 12


def test_a_map_in_which_nothing_is_wrong_is_left_out():
    method = examples.methods()[1]
    (run, *others) = method.runs
    location = replace(run.scores["location_error_mm"], per_taxel=np.full(36, 1e-15))
    right = replace(run, scores={**run.scores, "location_error_mm": location})
    captions = [
        [picture.caption for picture in failures([one], one).pictures]
        for one in (method, replace(method, runs=(right, *others)))
    ]
    assert captions[0] == [*captions[1], "Where the place is worst, over all test frames."]


def test_a_report_without_recordings_or_model_still_stands(tmp_path):
    path = write_report(tmp_path / "report.html", ReportInputs("small", examples.methods()[:1]))
    outline = Outline()
    outline.feed(path.read_text(encoding="utf-8"))
    assert outline.headings == ["How well the network does", "Where it fails"]


def test_the_section_has_a_column_for_each_grid():
    of_grid = [
        replace(examples.method(f"{name} {grid}", "network", noise_n, 2), grid=grid)
        for name, noise_n in (("paper", 0.6), ("reciprocal", 0.1))
        for grid in ("3x3", "6x6")
    ]
    section = grids([*of_grid, examples.method("mean 6x6", "yardstick", 1.0, 1)])
    assert section is not None
    (table,) = section.tables
    assert table.heads == ("metric and network", "3x3", "6x6")
    rows = {row.cells[0]: row.cells[1:] for row in table.rows}
    values = of_grid[0].values("force_rmse_one_n")
    expected = (f"{values.mean():.2f}", f"{values.min():.2f} to {values.max():.2f}")
    assert rows["force RMSE, one point / N", "paper"][0] == expected
    assert section.words[-1] == "Test frames: 3x3 on 302, 6x6 on 302."
    assert grids(of_grid[:1]) is None


def test_names_from_files_are_escaped():
    html = render(Page("<b>rig</b>", "", sections=(Section("a & b", ("<script>",)),)))
    assert "<script>" not in html
    assert "&lt;b&gt;rig&lt;/b&gt;" in html


def test_an_unknown_method_or_none_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no method is named"):
        write_report(tmp_path / "report.html", replace(examples.inputs(), shown="nobody"))
    with pytest.raises(ValueError, match="at least one method"):
        write_report(tmp_path / "report.html", ReportInputs("empty", []))
    assert list(tmp_path.iterdir()) == []


def test_results_are_kept_as_json_and_csv(tmp_path):
    import csv
    import json

    methods = examples.methods()
    as_json, as_csv = write_results(tmp_path, methods, {"seeds": 3})
    found = json.loads(as_json.read_text(encoding="utf-8"))
    assert found["format"] == "ertskin-evaluation"
    assert found["paper"]["hit_rate_one"] == {"value": 0.82, "spread": 0.12}
    seed = found["methods"][0]["seeds"][2]["metrics"]["exact_rate_two"]
    assert seed["value"] == methods[0].runs[2].scores["exact_rate_two"].value
    assert len(seed["per_taxel"]) == 36
    with as_csv.open(encoding="utf-8") as stream:
        rows = {(row["method"], row["metric"]): row for row in csv.DictReader(stream)}
    mean = methods[1].values("force_rmse_one_n").mean()
    assert float(rows["paper's pipeline", "force_rmse_one_n"]["mean"]) == pytest.approx(mean, rel=1e-5)
    assert ("Cramér-Rao bound", "hit_rate_one") not in rows


def test_method_results_average_their_seeds():
    method: MethodResult = examples.methods()[0]
    expected = np.mean([run.scores["hit_rate_one"].per_taxel for run in method.runs], axis=0)
    np.testing.assert_array_equal(method.per_taxel("hit_rate_one"), expected)

"""The reports in a real browser, where one is installed: pictures are drawn, links lead somewhere, all is in sight."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import report_examples as examples
from browser import CHROMIUM, Browser

from ertskin.calibration.drawing import FIGURES
from ertskin.report.figures.image import save_png
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.page import Page, Picture, Row, Section, Table, write_page
from ertskin.report.report import write_report

LONG = "contact_pressure_dependence_with_sheet_inhomogeneity_and_piezo_hysteresis"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """An evaluation's report, and a page whose names, commands and tables are wider than any window."""
    folder = tmp_path_factory.mktemp("pages")
    for name in FIGURES:
        save_png(taxel_map(examples.TAXEL_M, np.arange(36.0), f"{name} / 1"), folder / f"{name}.png")
    report = write_report(folder / "report.html", examples.inputs(folder))
    picture = Picture.of(taxel_map(examples.TAXEL_M, np.arange(36.0), "force / N"), "<b>forces</b>", wide=True)
    wide = Table(tuple(f"{LONG} {column}" for column in range(12)), (Row((("1.0", "± 0.1"),) * 12),))
    section = Section(LONG, facts=((LONG, LONG),), commands=(f"ertskin train effects={LONG * 3}",), tables=(wide,))
    long = Page(f"Diagnosis of {LONG * 2}.h5", LONG, (), (section, Section("Forces", pictures=(picture,))), (LONG * 4,))
    return report, write_page(folder / "long.html", long)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    browser = Browser(str(CHROMIUM), tmp_path_factory.mktemp("browser"))
    yield browser
    browser.close()


@pytest.mark.skipif(CHROMIUM is None, reason="no browser is installed")
@pytest.mark.parametrize("number", [0, 1])
def test_a_report_is_whole_in_a_wide_window_and_on_a_phone(
    browser: Browser, pages: tuple[Path, Path], number: int
) -> None:
    browser.open(pages[number].as_uri())
    browser.wait_until("document.readyState === 'complete' && document.images.length > 0")
    broken = "[...document.images].filter((image) => !image.complete || image.naturalWidth < 100).length"
    assert browser.value(broken) == 0
    lost = "[...document.querySelectorAll('nav a')].filter((a) => !document.querySelector(a.hash)).length"
    assert browser.value(lost) == 0
    for width in (1280, 400):
        browser.resize(width, 900)
        # Tables wider than the window are scrolled by themselves, never the page with them.
        assert browser.value("document.documentElement.scrollWidth") <= width
    assert browser.errors() == []

"""The documentation: its examples run, its tables are those of the code, its pages fetch nothing from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ertskin
from ertskin.commands import verbs
from ertskin.diagnosis.criteria import described
from ertskin.physics.effects.registry import effect_classes

ROOT = Path(__file__).resolve().parents[2]


def code(page: str, title: str) -> str:
    """The block of that title on a page."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    found = re.search(rf'```\w+ title="{title}"\n(.*?)```', text, re.DOTALL)
    assert found is not None, title
    return found.group(1)


def test_the_five_lines_write_a_recording(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    lines = code("how-to/library.md", "five lines")
    assert len(lines.splitlines()) == 5
    rng = np.random.default_rng(0)
    given = {
        "contact_m": [[0.03, 0.03], [0.09, 0.06]],
        "force_n": [2.0, 5.0],
        "voltage_v": rng.normal(scale=0.5, size=(5, 16, 16)).astype(np.float32),
    }
    exec(lines, {"ertskin": ertskin, **given})
    read = ertskin.read_recording("mine.h5")
    assert read.sensor is not None
    assert read.sensor.electrodes == 16
    assert read.frames is not None
    np.testing.assert_array_equal(read.frames.voltage_v, given["voltage_v"])
    assert read.frames.history.force_n[:, 0].tolist() == pytest.approx([np.nan, 2, np.nan, 5, np.nan], nan_ok=True)


def test_what_matlab_writes_is_read(tmp_path: Path) -> None:
    """The fields that the page's MATLAB lines write, with MATLAB's dimensions reversed."""
    import h5py

    lines = code("recording-format.md", "an adjacent tank")
    written = dict(re.findall(r"h5write\(f, '/(\S+)', (.*?)\);", lines))
    attributes = re.findall(r"h5writeatt\(f, '(\S+)', '(\w+)', (\S+)\);", lines)
    ring = np.arange(16)
    pairs = np.stack([ring, (ring + 1) % 16], axis=1)
    sensor = ertskin.sensor_of({"radius_m": 0.1, "edge_electrodes": {"count": 16, "width_m": 0.02}})
    values = {
        "frames/voltage_v": np.random.default_rng(0).normal(scale=0.1, size=(4, 16, 16)).astype(np.float32),
        "frames/time_s": 0.05 * np.arange(4),
        "frames/press": np.zeros(4, dtype=np.int32),
        "frames/phase": np.zeros(4, dtype=np.uint8),
        "protocol/injection": pairs.astype(np.int32),
        "protocol/measurement": pairs.astype(np.int32),
        "sensor/outline_m": sensor.outline_m,
        "sensor/electrode_edge_m": sensor.electrode_edge_m,
    }
    assert set(written) == set(values)
    with h5py.File(tmp_path / "mine.h5", "w") as file:
        for name, value in values.items():
            file[name] = value
        for group, name, value in attributes:
            file[group].attrs[name] = value.strip("'") if value.startswith("'") else float(value)
    read = ertskin.read_recording(tmp_path / "mine.h5")
    np.testing.assert_array_equal(read.frames.voltage_v, values["frames/voltage_v"])


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site, built strictly: a broken link or a missing name ends it."""
    pytest.importorskip("mkdocs", reason="make docs installs what builds the site")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_pages_fetch_nothing_from_elsewhere(site: Path) -> None:
    fetched = re.compile(r'<(?:script|img|iframe|source)\b[^>]*\bsrc="(https?:)?//|<link\b[^>]*\bhref="(https?:)?//')
    pages = list(site.rglob("*.html"))
    assert len(pages) >= 17
    assert [page.name for page in pages if fetched.search(page.read_text(encoding="utf-8"))] == []


def test_the_tables_are_those_of_the_code(site: Path) -> None:
    commands = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    effects = (site / "reference" / "effects.html").read_text(encoding="utf-8")
    assert [name for name in verbs() if f'id="{name}"' not in commands] == []
    assert [name for name in effect_classes() if f'id="{name}"' not in effects] == []
    criteria = (site / "reference" / "criteria.html").read_text(encoding="utf-8")
    assert [name for name in described() if f"<td><code>{name}</code></td>" not in criteria] == []


def test_equations_and_signatures_are_on_the_pages(site: Path) -> None:
    physics = (site / "physics.html").read_text(encoding="utf-8")
    assert physics.count("<math") > 20
    assert "\\frac" not in physics
    library = (site / "reference" / "library.html").read_text(encoding="utf-8")
    missing = [
        name for name in ertskin.__all__ if name not in ("__version__", "Diagnosis") and f">{name}<" not in library
    ]
    assert missing == []

"""What is installed: whole, and clear of a user's own ``physics.py``, from source, editable, sdist and wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """
import ertskin, physics, hardware
from ertskin.physics.skin import Skin
from ertskin.configuration import choices, config_dir
from ertskin.physics.effects.registry import effect_classes
assert physics.MINE and hardware.MINE
assert ertskin.read_recording.__module__ == "ertskin.hardware.recording"
assert len(effect_classes()) >= 17 and "paper" in choices("model")
print(ertskin.__file__)
"""


@pytest.fixture(scope="module")
def archives(tmp_path_factory) -> tuple[Path, Path]:
    """The sdist, and the wheel that is built from what it holds."""
    folder = tmp_path_factory.mktemp("archives")
    sdist = built(ROOT, "sdist", folder)
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    return sdist, built(folder / sdist.name.removesuffix(".tar.gz"), "wheel", folder)


def built(source: Path, target: str, folder: Path) -> Path:
    before = set(folder.iterdir())
    command = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (made,) = {path for path in folder.iterdir() if path.is_file()} - before
    return made


def tracked(pattern: str) -> set[str]:
    """Files of the checkout, named from its root."""
    return {
        str(path.relative_to(ROOT)) for path in ROOT.glob(pattern) if path.is_file() and "__pycache__" not in path.parts
    }


def test_the_archives_are_whole(archives: tuple[Path, Path]) -> None:
    sdist, wheel = archives
    with tarfile.open(sdist) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    top = tracked("conf/**/*") | tracked("physics/**/*") | tracked("hardware/**/*")
    own = {
        name
        for name in tracked("src/ertskin/**/*")
        if not name.startswith(("src/ertskin/physics/", "src/ertskin/hardware/"))
    }
    assert len(top) > 190
    assert {"src/ertskin/py.typed", "src/ertskin/live/page.html"} <= own
    assert (top | own) - packed == set()
    with zipfile.ZipFile(wheel) as archive:
        installed = archive.namelist()
    assert len(installed) == len(set(installed))
    assert {f"ertskin/{name}" for name in top} | {name.removeprefix("src/") for name in own} <= set(installed)
    assert {name.partition("/")[0] for name in installed} == {
        "ertskin",
        f"ertskin-{wheel.name.split('-')[1]}.dist-info",
    }


@pytest.mark.parametrize("way", ["source", "installed", "wheel"])
def test_a_users_own_physics_does_no_harm(way: str, archives: tuple[Path, Path], tmp_path: Path) -> None:
    for name in ("physics", "hardware"):
        (tmp_path / f"{name}.py").write_text("MINE = True\n")
    (tmp_path / "mine.py").write_text(SCRIPT)
    target = tmp_path / "target"
    if way == "wheel":
        with zipfile.ZipFile(archives[1]) as archive:
            archive.extractall(target)
    where = {"source": str(ROOT / "src"), "installed": "", "wheel": str(target)}[way]
    environment = {**os.environ, "PYTHONPATH": where}
    done = subprocess.run([sys.executable, "mine.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().startswith(where)

"""What ``import ertskin`` offers: there, documented, typed, imported when it is asked for."""

from __future__ import annotations

import inspect
import subprocess
import sys
from enum import EnumType
from pathlib import Path

import pytest

import ertskin

FIRST_WORDS = "import sys, time; begin = time.perf_counter(); import ertskin; took = time.perf_counter() - begin; "


def script(text: str) -> str:
    """What a fresh interpreter prints."""
    return subprocess.run([sys.executable, "-c", text], check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.parametrize("name", [name for name in ertskin.__all__ if name != "__version__"])
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(ertskin, name)
    assert inspect.getdoc(value), name
    assert name in dir(ertskin)
    if inspect.isfunction(value):
        unannotated = [p for p in inspect.signature(value).parameters.values() if p.annotation is p.empty]
        assert not unannotated, name
    elif not isinstance(value, EnumType):
        assert isinstance(value, type)


def test_the_lists_of_names_agree() -> None:
    assert sorted({*ertskin._HOME, "__version__"}) == sorted(ertskin.__all__)
    assert (Path(ertskin.__file__).parent / "py.typed").is_file()


def test_importing_costs_milliseconds_and_brings_nothing_along() -> None:
    heavy = ["numpy", "scipy", "torch", "h5py", "hydra", "lightning", "mlflow", "matplotlib"]
    loaded = script(FIRST_WORDS + f"print(*[m for m in {heavy} if m in sys.modules]); assert took < 0.5, took")
    assert loaded == ""


def test_reading_a_recording_needs_no_torch() -> None:
    text = FIRST_WORDS + "ertskin.read_recording, ertskin.sensor_of, ertskin.calibrate, ertskin.simulate; "
    assert script(text + "print('torch' in sys.modules, 'mlflow' in sys.modules)") == "False False"


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'callibrate'"):
        ertskin.callibrate  # noqa: B018

"""A trained network behind MLflow's generic interface: ``mlflow.pyfunc.load_model`` needs ertskin installed, no more.

The file it loads is the checkpoint itself, read without executing anything from it.
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.models.reconstruction import Reconstruction


class PyFuncReconstruction:
    """What ``load_model`` wraps."""

    def __init__(self, reconstruction: Reconstruction) -> None:
        self.reconstruction = reconstruction

    def predict(self, change_v: Any, params: dict[str, Any] | None = None) -> dict[str, NDArray[Any]]:
        """Of (N,K,M) changes of the raw readings against rest, in volt: the fields of an ``Estimate`` that it has."""
        estimate = self.reconstruction.estimate(np.asarray(change_v))
        answers = {each.name: getattr(estimate, each.name) for each in fields(estimate)}
        return {name: answer for name, answer in answers.items() if answer is not None}


def _load_pyfunc(path: str) -> PyFuncReconstruction:
    """The hook MLflow calls with the path of the model's file."""
    return PyFuncReconstruction(Reconstruction.load(Path(path)))

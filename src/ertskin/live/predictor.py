"""The network at work on live scans, from an ONNX file and without torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.errors import UserError
from ertskin.models.deciding import estimate_of, posterior_of, proposals
from ertskin.models.estimate import Estimate
from ertskin.models.monitor import SkinMonitor
from ertskin.models.votes import counted, on_taxels
from ertskin.physics.touch.search import Held, TouchPosterior

Array = NDArray[np.float64]
ABOUT = "ertskin"
COORDINATES = "coordinates_v"
TABLE_SUFFIX = ".npz"
"""Of the arrays beside an exported network: its monitor, and the forward model of one that proposes contacts."""


@dataclass(frozen=True)
class Kind:
    """What the numbers of a model mean: as exported beside its graph."""

    kind: str
    shape: tuple[int, int]
    taxel_m: Array
    threshold: float
    spacing_m: float


class Predictor:
    """Touches from changes of raw readings, one thread, no torch."""

    def __init__(self, path: Path) -> None:
        """Raises ``UserError`` for a file that is no exported reconstruction."""
        import onnxruntime

        if not path.is_file():
            raise UserError(f"no model at {path}")
        options = onnxruntime.SessionOptions()
        # The coordinates, which need not be given, are warned of as an input with a default.
        options.log_severity_level = 3
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
            about = json.loads(self._session.get_modelmeta().custom_metadata_map[ABOUT])
            self.kind = _kind(about)
        except Exception as error:
            # onnxruntime raises classes of its own for each way a file can be bad.
            raise UserError(f"{path} is no exported model: {str(error).splitlines()[0]}") from None

        numbers = {given.name: int(given.shape[-1]) for given in self._session.get_overridable_initializers()}
        self.reads_coordinates = COORDINATES in numbers
        """Whether it can ``estimate_coordinates``: a network that reads more than those can't."""
        held = _held_arrays(path)
        self.monitor = SkinMonitor.of(held)
        self._posterior = _posterior(path, held) if self.kind.kind == "contacts" else None
        self._whitening: Array | None = None
        if self._posterior is not None and self.reads_coordinates:
            # Readings are linear in the coordinates: those of each alone are the matrix.
            alone = self._of_coordinates(np.eye(numbers[COORDINATES]))
            self._whitening = self._session.run(None, alone)[3].astype(float)

    def estimate(self, change_v: NDArray[np.floating]) -> Estimate:
        """Touches of (N,K,M) or (N,R) changes of the raw readings against rest, in volt."""
        flat = np.ascontiguousarray(change_v, dtype=np.float32).reshape(len(change_v), -1)
        return self._estimate({"change_v": flat})

    def estimate_coordinates(self, coordinates_v: Array) -> Estimate:
        """Touches of (N,n) changes of the whitened coordinates, in volt: the same, faster where these are known."""
        return self._estimate(self._of_coordinates(coordinates_v))

    def followed(self, coordinates_v: Array, held: Held | None) -> tuple[Estimate, Held | None]:
        """Touches of one scan (n,), and what to hold of them for the next: contacts that stay aren't searched for
        again, nor is the network asked (``TouchPosterior.followed``)."""
        given = self._of_coordinates(coordinates_v[None])
        if self._posterior is None or self._whitening is None:
            return self._estimate(given), None

        def propose() -> Array:
            return self._proposed(self._session.run(None, given))[1][0]

        beliefs, held = self._posterior.followed(coordinates_v @ self._whitening, propose, held)
        return estimate_of(beliefs, self.kind.taxel_m), held

    def rehearse(self, coordinates_v: Array) -> None:
        """Ask the network of a scan (n,) that needs no answer: a touch may begin with the next, and weights that lie in
        memory only, not in the processor's cache, take a quarter of a millisecond more."""
        if self.reads_coordinates:
            self._session.run(None, self._of_coordinates(coordinates_v[None]))

    def _of_coordinates(self, coordinates_v: Array) -> dict[str, NDArray[np.float32]]:
        nothing = np.zeros((0, self.kind.shape[0] * self.kind.shape[1]), dtype=np.float32)
        return {"change_v": nothing, COORDINATES: coordinates_v.astype(np.float32)}

    def _proposed(self, answers: list[Any]) -> tuple[Array, Array]:
        """Readings (N,D) in units of the noise, and the contacts (N,C,3) the network proposes in them."""
        assert self._posterior is not None
        probability, force, place_m, readings = (answer.astype(float) for answer in answers)
        settings = (self.kind.spacing_m, self.kind.threshold, self._posterior.most)
        return readings, proposals(probability, force, place_m, *settings)

    def _estimate(self, given: dict[str, NDArray[np.float32]]) -> Estimate:
        answers: list[Any] = self._session.run(None, given)
        if self._posterior is not None:
            return estimate_of(self._posterior.of(*self._proposed(answers)), self.kind.taxel_m)
        probability, force = (answer.astype(float) for answer in answers[:2])
        if self.kind.kind == "places":
            votes = zip(probability, force, answers[2].astype(float), strict=True)
            radius = 0.5 * self.kind.spacing_m
            found = [counted(*vote, radius_m=radius, threshold=self.kind.threshold) for vote in votes]
            return on_taxels(found, self.kind.taxel_m)
        present = probability > self.kind.threshold
        return Estimate(present * force, present)


def _held_arrays(path: Path) -> dict[str, Any]:
    """The arrays exported with a network: its monitor's, and the forward model of one that proposes contacts."""
    table = path.with_suffix(TABLE_SUFFIX)
    if not table.is_file():
        return {}
    with np.load(table, allow_pickle=False) as held:
        return dict(held)


def _posterior(path: Path, held: dict[str, Any]) -> TouchPosterior:
    """The forward model of a network that proposes contacts."""
    if "response" not in held:
        raise UserError(
            f"{path} needs the table exported with it, and there is none in {path.with_suffix(TABLE_SUFFIX)}"
        )
    # No scan may wait for a long search: what fits poorly shows in the misfit.
    return posterior_of(held, float(held["least_force_n"]), int(held["most"]), exchanges=0)


def _kind(about: dict[str, Any]) -> Kind:
    injections, readings = about["shape"]
    return Kind(
        str(about["kind"]),
        (int(injections), int(readings)),
        np.array(about["taxel_m"], dtype=float).reshape(-1, 2),
        float(about["threshold"]),
        float(about["spacing_m"] or 0.0),
    )

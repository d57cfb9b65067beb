"""A trained network from wherever it is kept, asked with numpy frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING
from typing import Protocol as Interface

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ertskin.errors import UserError
from ertskin.models.estimate import Estimate

if TYPE_CHECKING:
    from ertskin.models.reconstruction import Reconstruction

Array = NDArray[np.float64]
RUN = "runs:/"


class Estimator(Interface):
    """What turns changes of readings into touches: a checkpoint in torch or a graph in onnxruntime."""

    def estimate(self, change_v: Array) -> Estimate:
        """Touches of (N,K,M) changes against rest, in volt."""


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A network ready for frames.

    ``shape`` (K,M): injections and readings of the scans it was trained on. ``taxel_m`` (n,2): where its taxels are.
    """

    estimator: Estimator
    shape: tuple[int, int]
    taxel_m: Array

    def predict(self, frames_v: ArrayLike, rest_v: ArrayLike | None = None) -> Estimate:
        """Touches of scans as they were read.

        Args:
            frames_v: (N,K,M) volt, or (K,M) for a single scan. A network answers for what is touched: it was trained on
                nothing else, and finds something in the noise of an untouched scan too, unless ``rest_v`` tells it how
                large that noise is.
            rest_v: untouched scans (R,K,M) or (K,M) in volt, the newest there are: their mean is what changes count
                from, and two or more tell the noise below which nothing is a touch. Without them the first frame is
                taken as untouched, as it is in every recording.

        Returns:
            ``force_map_n`` (N,n) newton on each taxel, ``present`` (N,n), and from a network that places contacts
            itself ``contact_m`` (N,C,2) and ``contact_force_n`` (N,C), NaN for none.

        Raises:
            UserError: for frames of another scan than the network was trained on.
        """
        frames = self._scans(frames_v, "frames_v")
        rest = frames[:1] if rest_v is None else self._scans(rest_v, "rest_v")
        change = frames - rest.mean(axis=0)
        estimate = self.estimator.estimate(change)
        return estimate if len(rest) < 2 else _only(estimate, _touched(change, rest))

    def _scans(self, scans_v: ArrayLike, name: str) -> Array:
        scans = np.asarray(scans_v, dtype=float)
        if scans.shape[-2:] != self.shape or scans.ndim not in (2, 3) or not scans.size:
            injections, readings = self.shape
            raise UserError(f"{name} has shape {scans.shape}, the network reads scans of (N, {injections}, {readings})")
        return scans.reshape(-1, *self.shape)


def load_network(source: str | PathLike[str]) -> TrainedNetwork:
    """The network at ``source``, loaded without executing anything from the file.

    Args:
        source: the folder of a training job or its ``model.pt``; an exported ``.onnx`` file, which needs no torch; or
            ``runs:/ID`` for a run of MLflow, kept where the ``tracking`` settings say.

    Raises:
        UserError: where there is no network.
    """
    if str(source).startswith(RUN):
        return _of_run(str(source).removeprefix(RUN).split("/")[0])
    path = Path(source)
    path = path / "model.pt" if path.is_dir() else path
    return _of_graph(path) if path.suffix == ".onnx" else _of_checkpoint(path)


def _of_graph(path: Path) -> TrainedNetwork:
    from ertskin.live.predictor import Predictor

    predictor = Predictor(path)
    return TrainedNetwork(predictor, predictor.kind.shape, predictor.kind.taxel_m)


def _of_checkpoint(path: Path) -> TrainedNetwork:
    from ertskin.models.reconstruction import Reconstruction

    return _of_reconstruction(Reconstruction.load(path))


def _of_run(run_id: str) -> TrainedNetwork:
    from omegaconf import OmegaConf

    from ertskin.configuration import config_dir
    from ertskin.tracking.model import load_model
    from ertskin.tracking.settings import TrackingSettings

    kept = OmegaConf.load(config_dir() / "tracking" / "mlflow.yaml")
    return _of_reconstruction(load_model(TrackingSettings.of(kept), run_id))  # type: ignore[arg-type]


def _of_reconstruction(reconstruction: Reconstruction) -> TrainedNetwork:
    taxel_m = np.asarray(reconstruction.network.taxel_m, dtype=float).reshape(-1, 2)
    return TrainedNetwork(reconstruction, reconstruction.protocol.shape, taxel_m)


def _touched(change_v: Array, rest_v: Array) -> NDArray[np.bool_]:
    from ertskin.live.session import noise_of, touched

    return touched(change_v, noise_of(rest_v), len(rest_v))


def _only(estimate: Estimate, touched: NDArray[np.bool_]) -> Estimate:
    """The estimate with nothing declared in the frames that nothing touches."""
    contacts = {}
    if estimate.contact_m is not None and estimate.contact_force_n is not None:
        contacts = {
            "contact_m": np.where(touched[:, None, None], estimate.contact_m, np.nan),
            "contact_force_n": np.where(touched[:, None], estimate.contact_force_n, np.nan),
        }
    present = estimate.present & touched[:, None]
    return replace(estimate, force_map_n=np.where(present, estimate.force_map_n, 0.0), present=present, **contacts)

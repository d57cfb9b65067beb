"""The trained model as an MLflow model of its run, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ertskin import __version__
from ertskin.errors import UserError
from ertskin.models.reconstruction import Reconstruction
from ertskin.tracking import pyfunc
from ertskin.tracking.run import Run
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import open_store

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import LoggedModel

NAME, FILE = "model", "model.pt"


def log_model(run: Run, path: Path, example_v: NDArray[np.float32] | None = None) -> None:
    """Log a file ``Reconstruction.save`` wrote, once, with what it takes in and gives.

    ``example_v`` (N,K,M): some changes of the raw readings, in volt; an untouched scan where none is given.
    """
    import mlflow
    from mlflow.models import Model

    if path.name != FILE:
        raise ValueError(f"the model's file must be called {FILE}, not {path.name}")
    if _logged(run.client, run.run_id) is not None:
        return  # By an attempt that was cut off after it.
    reconstruction = Reconstruction.load(path)
    if example_v is None:
        example_v = np.zeros((1, *reconstruction.protocol.shape), dtype=np.float32)
    mlflow.set_tracking_uri(run.client.tracking_uri)
    info = run.client.get_run(run.run_id)
    model = run.client.create_logged_model(
        info.info.experiment_id, NAME, source_run_id=run.run_id, params=info.data.params
    )
    Model.log(
        artifact_path=None,
        name=NAME,
        flavor=mlflow.pyfunc,
        run_id=run.run_id,
        model_id=model.model_id,
        loader_module=pyfunc.__name__,
        data_path=str(path),
        signature=_signature(reconstruction, example_v),
        input_example=example_v,
        pip_requirements=[f"ertskin=={__version__}"],
    )


def model_file(name: str, settings: TrackingSettings) -> Path:
    """A model's file, named by itself, by the folder of a job, or by the id of an MLflow run; raises ``UserError``."""
    path = Path(name) / FILE if Path(name).is_dir() else Path(name)
    return path if path.is_file() else _of_run(settings, name)


def load_model(settings: TrackingSettings, run_id: str) -> Reconstruction:
    """The model of a run, loaded without executing anything from the file; ``UserError`` where the run has none."""
    return Reconstruction.load(_of_run(settings, run_id))


def _of_run(settings: TrackingSettings, run_id: str) -> Path:
    from mlflow.artifacts import download_artifacts
    from mlflow.exceptions import MlflowException

    try:
        model = _logged(open_store(settings.database), run_id)
    except MlflowException as error:
        raise UserError(f"run {run_id} has no model in {settings.database}: {error}") from error
    if model is None:
        raise UserError(f"run {run_id} has no model in {settings.database}")
    (file,) = Path(download_artifacts(artifact_uri=model.artifact_location)).rglob(FILE)
    return file


def _logged(client: MlflowClient, run_id: str) -> LoggedModel | None:
    """The run's model that was logged whole."""
    from mlflow.entities import LoggedModelStatus

    outputs = client.get_run(run_id).outputs
    models = [] if outputs is None else [client.get_logged_model(each.model_id) for each in outputs.model_outputs]
    return next((model for model in models if model.status == LoggedModelStatus.READY), None)


def _signature(reconstruction: Reconstruction, example_v: NDArray[np.float32]) -> Any:
    from mlflow.models import ModelSignature
    from mlflow.types import Schema, TensorSpec

    answers = pyfunc.PyFuncReconstruction(reconstruction).predict(example_v)
    taken = TensorSpec(example_v.dtype, (-1, *example_v.shape[1:]), None)
    # How many contacts a network places differs from frame to frame.
    given = Schema(
        [TensorSpec(a.dtype, (-1, *(-1 for _ in a.shape[1:2]), *a.shape[2:]), name) for name, a in answers.items()]
    )
    return ModelSignature(Schema([taken]), given)

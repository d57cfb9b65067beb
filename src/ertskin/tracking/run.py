"""One MLflow run: begun or gone on with, fed in batches, and closed with the status it deserves."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from ertskin.errors import UserError
from ertskin.interrupts import Terminated
from ertskin.tracking.datasets import DatasetInfo
from ertskin.tracking.process import is_gone, own_tags
from ertskin.tracking.settings import TrackingSettings
from ertskin.tracking.store import experiment_id, open_store

if TYPE_CHECKING:
    from mlflow import MlflowClient

KEY_TAG, ERROR_TAG, PARENT_TAG = "ertskin.key", "ertskin.error", "mlflow.parentRunId"
# By this MLflow knows which of a run's files are tables.
TABLES_TAG = "mlflow.loggedArtifacts"
# MLflow cuts longer values of a parameter; the whole configuration is an artifact.
PARAMETER_LENGTH = 250
AT_ONCE = 1000


class Run:
    """A run as a context: FINISHED when left in peace, KILLED on Ctrl-C or SIGTERM, FAILED on any other error.

    Metrics are kept back and written together, at most every ``flush_s`` seconds.
    """

    def __init__(self, client: MlflowClient, run_id: str, flush_s: float) -> None:
        self.client, self.run_id, self.flush_s = client, run_id, flush_s
        self._waiting: list[Any] = []
        self._flushed_s = time.monotonic()

    @classmethod
    def begin(
        cls,
        settings: TrackingSettings,
        key: str,
        name: str,
        tags: Mapping[str, str] | None = None,
        parent_run_id: str | None = None,
        reopen: bool = False,
    ) -> Run:
        """The unfinished run of this ``key`` (with ``reopen`` a finished one too), or a new one.

        Runs whose process died are mended on the way.
        """
        client = open_store(settings.database)
        experiment = experiment_id(client, settings.experiment, settings.artifacts)
        mend(client, experiment)
        labels = {
            **(tags or {}),
            **own_tags(),
            KEY_TAG: key,
            "mlflow.source.name": "ertskin",
            "mlflow.source.type": "LOCAL",
        }
        if parent_run_id is not None:
            labels[PARENT_TAG] = parent_run_id
        if commit := source_commit():
            labels["mlflow.source.git.commit"] = commit
        known = [run for run in _of_key(client, experiment, key) if reopen or run.info.status != "FINISHED"]
        if known:
            run_id = known[0].info.run_id
            client.update_run(run_id, status="RUNNING")
            if ERROR_TAG in known[0].data.tags:
                client.delete_tag(run_id, ERROR_TAG)
            for label, value in labels.items():
                client.set_tag(run_id, label, value)
        else:
            run_id = client.create_run(experiment, tags=labels, run_name=name).info.run_id
        return cls(client, run_id, settings.flush_s)

    def parameters(self, config: Mapping[str, Any], named: Mapping[str, str] | None = None) -> None:
        """Log a nested configuration: as parameters ``a.b.c`` to sort and compare by, and whole as ``config.yaml``.

        ``named``: parameters that come first, as the names of choices. What only tells Hydra what to build is left out.
        """
        from mlflow.entities import Param
        from omegaconf import OmegaConf

        settings = {name: value for name, value in flattened(config).items() if not _is_hydras(name)}
        flat = {name: str(value) for name, value in {**(named or {}), **settings}.items()}
        known = self.client.get_run(self.run_id).data.params
        new = [Param(n, v) for n, v in flat.items() if n not in known and len(v) <= PARAMETER_LENGTH]
        for start in range(0, len(new), 100):
            self.client.log_batch(self.run_id, params=new[start : start + 100])
        self.client.log_text(self.run_id, OmegaConf.to_yaml(OmegaConf.create(dict(config))), "config.yaml")

    def dataset(self, data: DatasetInfo) -> None:
        """Log what the run learned from or was tested on.

        MLflow looks for the same data set and then writes it: where another process has come between, it finds it when
        asked again.
        """
        from mlflow.exceptions import MlflowException

        try:
            self.client.log_inputs(self.run_id, datasets=[data.as_input()])
        except MlflowException as error:
            if "UNIQUE constraint failed: datasets" not in str(error):
                raise
            self.client.log_inputs(self.run_id, datasets=[data.as_input()])

    def metrics(self, values: Mapping[str, float], step: int = 0) -> None:
        """Keep metrics for the next write."""
        from mlflow.entities import Metric

        now_ms = int(time.time() * 1000)
        self._waiting += [Metric(name, float(value), now_ms, step) for name, value in values.items()]
        if time.monotonic() - self._flushed_s >= self.flush_s:
            self.flush()

    def flush(self) -> None:
        """Write the metrics kept back."""
        waiting, self._waiting = self._waiting, []
        for start in range(0, len(waiting), AT_ONCE):
            self.client.log_batch(self.run_id, metrics=waiting[start : start + AT_ONCE])
        self._flushed_s = time.monotonic()

    def table(self, content: Any, name: str) -> None:
        """Log plain data as a JSON artifact."""
        self.client.log_text(self.run_id, json.dumps(content, indent=1), name)

    def columns(self, columns: Mapping[str, Sequence[Any]], name: str) -> None:
        """Log columns of equal length as what MLflow shows as a table, in the place of an earlier one."""
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        self.table({"columns": list(columns), "data": rows}, name)
        self.tag(TABLES_TAG, json.dumps([{"path": name, "type": "table"}]))

    def artifact(self, path: Path, folder: str | None = None) -> None:
        """Log a file."""
        self.client.log_artifact(self.run_id, str(path), folder)

    def figure(self, figure: Any, name: str) -> None:
        """Log a matplotlib figure."""
        self.client.log_figure(self.run_id, figure, name)

    def tag(self, name: str, value: str) -> None:
        """Set a tag."""
        self.client.set_tag(self.run_id, name, value)

    def end(self, status: str) -> None:
        """Close the run with a status of MLflow's."""
        self.flush()
        self.client.set_terminated(self.run_id, status)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            self.end("FINISHED")
        elif isinstance(error, (KeyboardInterrupt, Terminated)):
            self.end("KILLED")
        else:
            self.tag(ERROR_TAG, f"{type(error).__name__}: {error}"[:500])
            self.end("FAILED")


def mend(client: MlflowClient, experiment: str) -> list[str]:
    """Mark runs as KILLED that say they are running though their process is gone; returns their ids."""
    gone = [
        run.info.run_id
        for run in client.search_runs([experiment], "attributes.status = 'RUNNING'", max_results=AT_ONCE)
        if is_gone(run.data.tags)
    ]
    for run_id in gone:
        client.set_terminated(run_id, "KILLED")
    return gone


def flattened(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one level, names joined by dots."""
    flat: dict[str, Any] = {}
    for name, value in config.items():
        flat |= flattened(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
    return flat


def _is_hydras(name: str) -> bool:
    return name.rpartition(".")[2].startswith("_")


def source_commit() -> str | None:
    """Commit of the checkout this code runs from, with ``-dirty`` where it has been changed; None outside of one."""
    folder = Path(__file__).resolve().parent
    command = ["git", "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() or None


def fetch(settings: TrackingSettings, run_id: str, artifact: str) -> Path:
    """Local path of a run's artifact; raises ``UserError`` where the run or the artifact isn't there."""
    from mlflow.artifacts import download_artifacts
    from mlflow.exceptions import MlflowException

    from ertskin.tracking.store import store_uri

    client = open_store(settings.database)
    try:
        client.get_run(run_id)
        return Path(
            download_artifacts(run_id=run_id, artifact_path=artifact, tracking_uri=store_uri(settings.database))
        )
    except (MlflowException, OSError) as error:
        raise UserError(f"run {run_id} has no {artifact} in {settings.database}: {error}") from error


def _of_key(client: MlflowClient, experiment: str, key: str) -> list[Any]:
    """Runs of this ``key``, the newest first."""
    return list(
        client.search_runs([experiment], f"tags.`{KEY_TAG}` = '{key}'", order_by=["attributes.start_time DESC"])
    )

"""Data sets as MLflow knows them: what a run learned from or was tested on, named by content."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from mlflow.entities import DatasetInput

DIGEST_LENGTH = 32  # MLflow's database takes 36 characters.
Context = Literal["training", "test"]


@dataclass(frozen=True)
class DatasetInfo:
    """``digest``: a checksum of the content. ``file``: where it lies, None for what the command made itself.
    ``profile``: numbers about it."""

    name: str
    digest: str
    context: Context
    file: Path | None = None
    profile: dict[str, Any] = field(default_factory=dict)

    def as_input(self) -> DatasetInput:
        """For MLflow's client."""
        from mlflow.entities import Dataset, DatasetInput, InputTag

        kind = "code"
        source: dict[str, Any] = {"tags": {"mlflow.source.name": "ertskin synthesize"}}
        if self.file is not None:
            kind, source = "local", {"uri": str(self.file.resolve())}
        data = Dataset(
            self.name, self.digest[:DIGEST_LENGTH], kind, json.dumps(source), profile=json.dumps(self.profile)
        )
        return DatasetInput(data, [InputTag("mlflow.data.context", self.context)])

"""Open the experiments' pages: every run with its settings, metrics, figures and model.

The pages are served by MLflow on this machine alone, until Ctrl-C.
"""

from __future__ import annotations

import webbrowser
from pathlib import Path

from omegaconf import DictConfig


def run(config: DictConfig) -> None:
    """Serve until interrupted."""
    from ertskin.settings import whole_number
    from ertskin.tracking.dashboard import experiment_url, serving, usable_port, wait_until_it_ends
    from ertskin.tracking.store import experiment_id, open_store

    database, artifacts = Path(config.tracking.database), Path(config.tracking.artifacts)
    port = usable_port(whole_number(config.port, "port", least=0, most=65535))
    experiment = experiment_id(open_store(database), config.tracking.experiment, artifacts)
    with serving(database, artifacts, port) as server:
        url = experiment_url(port, experiment)
        print(f"dashboard: {url}   (Ctrl-C ends it)", flush=True)
        if config.open:
            webbrowser.open(url)
        wait_until_it_ends(server)

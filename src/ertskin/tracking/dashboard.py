"""MLflow's pages, served on the loopback address only."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from ertskin.errors import JobFailed, UserError
from ertskin.tracking.store import ensure_database, store_uri

LOOPBACK = "127.0.0.1"


def experiment_url(port: int, experiment_id: str) -> str:
    """The experiment in the view for trained models; without the ending MLflow opens its view for language models."""
    return f"http://{LOOPBACK}:{port}/#/experiments/{experiment_id}/runs?workflowType=machine_learning"


def usable_port(port: int) -> int:
    """``port``, or a free one for 0; raises ``UserError`` where it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError as error:
            raise UserError(f"port {port} is taken: give another, or port=0 for any free one") from error
        return probe.getsockname()[1]


@contextmanager
def serving(database: Path, artifacts: Path, port: int, wait_s: float = 90.0) -> Iterator[subprocess.Popen[bytes]]:
    """Serve the database while the context lasts; yields once the pages answer."""
    ensure_database(database)
    command = [sys.executable, "-m", "mlflow", "server", "--host", LOOPBACK, "--port", str(port), "--workers", "1"]
    command += ["--backend-store-uri", store_uri(database), "--artifacts-destination", artifacts.resolve().as_uri()]
    quiet = {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    log = database.with_name("dashboard.log")
    with log.open("wb") as output:
        # A session of its own, so that Ctrl-C reaches us alone.
        server = subprocess.Popen(command, stdout=output, stderr=output, env=os.environ | quiet, start_new_session=True)
    try:
        _wait_until_healthy(server, port, wait_s, log)
        yield server
    finally:
        _end(server)


def wait_until_it_ends(server: subprocess.Popen[bytes]) -> None:
    """Return when the server has ended.

    In short sleeps: a Ctrl-C that comes just before an endless wait for the process begins would not end that wait.
    """
    while server.poll() is None:
        time.sleep(0.2)


def _wait_until_healthy(server: subprocess.Popen[bytes], port: int, wait_s: float, log: Path) -> None:
    deadline = time.monotonic() + wait_s
    while time.monotonic() < deadline and server.poll() is None:
        try:
            with urllib.request.urlopen(f"http://{LOOPBACK}:{port}/health", timeout=2) as answer:
                if answer.status == 200:
                    return
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            time.sleep(0.2)
    raise JobFailed(f"the dashboard did not start; its messages are in {log}")


def _end(server: subprocess.Popen[bytes]) -> None:
    """The server's worker ends with it."""
    processes: list[psutil.Process] = []
    with suppress(psutil.NoSuchProcess):
        process = psutil.Process(server.pid)
        processes = [*process.children(recursive=True), process]
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            process.terminate()
    for process in psutil.wait_procs(processes, timeout=10)[1]:
        process.kill()
    server.wait()

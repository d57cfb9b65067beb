"""Jobs of a SLURM queue, with ``sbatch`` and ``scancel`` played by two scripts that run them on this machine."""

import os
import signal
import stat
import sys
import time
from importlib.util import find_spec

import numpy as np
import pytest

SBATCH = """#!/bin/sh
# The script is removed once it is submitted.
cp "$1" "{folder}/job.sh"
setsid sh "{folder}/job.sh" > "{folder}/job.$$.out" 2>&1 &
echo $! >> "{folder}/submitted"
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
echo "$1" >> "{folder}/cancelled"
# A job just submitted may not lead its own group yet.
for turn in 1 2 3 4 5 6 7 8 9 10; do kill -TERM -- "-$1" && exit 0; sleep 0.2; done
"""


def square(number):
    return np.array([float(number**2), float(os.getpid())])


@pytest.fixture
def queue(tmp_path, monkeypatch):
    """A folder with the two commands, first on the path."""
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        command = tmp_path / name
        command.write_text(text.format(folder=tmp_path))
        command.chmod(command.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    return tmp_path


def running(job: str) -> bool:
    import psutil

    try:
        return psutil.Process(int(job)).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_pieces_are_computed_by_queued_jobs_which_are_cancelled_in_the_end(queue):
    if find_spec("dask_jobqueue") is None:
        pytest.skip("dask-jobqueue is an extra: pip install 'ertskin[cluster]'")
    from ertskin.cluster.dask import DaskCluster

    options = {"host": "127.0.0.1", "dashboard_address": None}
    cluster = DaskCluster(workers=2, slurm={"cores": 1, "memory": "1GB", "scheduler_options": options})
    done = dict(cluster.spread(square, range(6)))
    assert {number: value[0] for number, value in done.items()} == {k: float(k**2) for k in range(6)}
    assert os.getpid() not in {int(value[1]) for value in done.values()}
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    jobs = (queue / "submitted").read_text().split()
    assert len(jobs) == 2
    deadline = time.monotonic() + 30
    while any(running(job) for job in jobs):
        assert time.monotonic() < deadline
        time.sleep(0.1)
    assert sorted((queue / "cancelled").read_text().split()) == sorted(jobs)

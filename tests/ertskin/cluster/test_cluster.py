"""The same results wherever they are computed, also when a worker dies."""

import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch  # noqa: F401  brings the threads that are counted
from cluster_pieces import AlwaysDies, Bowl, DiesOnce, PagesTouched, Prepared, draw, fails, first, openmp_threads
from small_bench import write_small_bench
from threadpoolctl import threadpool_limits

from ertskin.cluster import LocalCluster
from ertskin.commands.diagnose import Diagnoses
from ertskin.data.synthesis import Plan, synthesize
from ertskin.diagnosis.criteria import Criteria
from ertskin.errors import JobFailed
from ertskin.hardware.recording import write_recording
from ertskin.physics.sensor import taxel_grid_m

sys.path.insert(0, str(Path(__file__).parents[2] / "hardware"))
from example_recording import example

pytestmark = pytest.mark.long

WITHOUT_DASK = "Dask is an extra: pip install 'ertskin[cluster]'"


class DiagnosesKilledOnce(Diagnoses):
    """Kills its worker once, when the diagnosis of recording 1 is on its way."""

    def diagnosed(self, number, report):
        marker = self.effects.parent.with_name("died")

        def killing(share, text):
            if number == 1 and (share or 0.0) > 0.3 and first(marker):
                os.kill(os.getpid(), signal.SIGKILL)
            report(share, text)

        return super().diagnosed(number, killing)


def as_dict(cluster, compute=draw):
    return {number: value.tolist() for number, value in cluster.spread(compute, range(5))}


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_give_what_one_process_gives(workers):
    assert as_dict(LocalCluster(workers)) == {k: draw(k).tolist() for k in range(5)}


def test_what_takes_long_to_build_is_built_once_and_travels(tmp_path):
    assert as_dict(LocalCluster(2), Prepared()) == {k: [1, True] for k in range(5)}
    pytest.importorskip("distributed", reason=WITHOUT_DASK)
    from ertskin.cluster.dask import DaskCluster

    assert as_dict(DaskCluster(workers=2), Prepared()) == {k: [1, True] for k in range(5)}


def test_a_workers_error_is_raised_here():
    with pytest.raises(ValueError, match="no such piece"):
        list(LocalCluster(2).spread(fails, range(3)))


def test_a_process_that_dies_costs_only_what_was_not_done(tmp_path):
    assert as_dict(LocalCluster(2), DiesOnce(tmp_path / "died")) == {k: draw(k).tolist() for k in range(5)}
    assert (tmp_path / "died").exists()


def test_one_process_is_limited_to_one_thread_only_while_it_computes():
    with threadpool_limits(2, user_api="openmp"):
        pieces = LocalCluster(1).spread(openmp_threads, range(2))
        for _, computing in pieces:
            assert computing == {1}
            assert openmp_threads() == {2}


def test_processes_that_keep_dying_are_given_up():
    with pytest.raises(JobFailed, match="keep dying"):
        list(LocalCluster(2).spread(AlwaysDies(), range(5)))


def test_dask_gives_the_same_also_when_a_worker_is_killed(tmp_path):
    pytest.importorskip("distributed", reason=WITHOUT_DASK)
    from ertskin.cluster.dask import DaskCluster

    assert as_dict(DaskCluster(workers=2), DiesOnce(tmp_path / "died")) == {k: draw(k).tolist() for k in range(5)}
    assert (tmp_path / "died").exists()


def test_dasks_only_worker_may_die(tmp_path):
    pytest.importorskip("distributed", reason=WITHOUT_DASK)
    from ertskin.cluster.dask import DaskCluster

    assert as_dict(DaskCluster(workers=1), DiesOnce(tmp_path / "died")) == {k: draw(k).tolist() for k in range(5)}


def test_a_dask_worker_keeps_the_memory_it_has():
    pytest.importorskip("distributed", reason=WITHOUT_DASK)
    from ertskin.cluster.dask import DaskCluster

    pages_a_megabyte = (1 << 20) / resource.getpagesize()
    touched = list(as_dict(DaskCluster(workers=1), PagesTouched()).values())
    assert max(touched[1:]) < 5 * pages_a_megabyte


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler and two workers without a keeper, each a process of its own; gives its address."""
    pytest.importorskip("distributed", reason=WITHOUT_DASK)
    file, environment = tmp_path / "scheduler.json", {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    begin = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--host", "127.0.0.1"]
    join = [sys.executable, "-m", "distributed.cli.dask_worker", "--no-nanny", "--no-dashboard", "--nthreads", "1"]
    commands = [[*begin, "--port", "0"], join, join]
    processes = [
        subprocess.Popen([*command, "--scheduler-file", str(file)], env=environment, stderr=subprocess.DEVNULL)
        for command in commands
    ]
    try:
        deadline = time.monotonic() + 120
        while not file.exists() or not file.stat().st_size:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        yield file, processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_trials_from_a_scheduler_are_those_of_one_process_though_a_worker_was_killed(tmp_path, scheduler):
    import json

    from distributed import Client

    from ertskin.cluster.dask import DaskCluster

    file, processes = scheduler
    address = json.loads(file.read_text())["address"]
    with Client(address) as client:
        client.wait_for_workers(2, timeout=120)
    plan, taxel_m = Plan(steps=5, trials=170, denoiser_trials=20, shard=20), taxel_grid_m((0.06, 0.06), 3, 3)

    def made(folder, forward, cluster):
        return synthesize(tmp_path / folder, {"skin": "bowl"}, plan, taxel_m, lambda: forward, cluster)

    by_threads = made("here", Bowl(), LocalCluster(1))
    by_dask = made("there", Bowl(tmp_path / "died"), DaskCluster(address))
    assert (tmp_path / "died").exists()
    assert sum(process.poll() is None for process in processes) == 2
    assert by_dask[2] == by_threads[2]
    assert np.array_equal(by_dask[0].change_ohm, by_threads[0].change_ohm)


@pytest.mark.timeout(600)
def test_diagnoses_from_a_scheduler_are_those_of_one_process_though_a_worker_was_killed(tmp_path, scheduler):
    import json

    from ertskin.cluster.dask import DaskCluster

    sources = (tmp_path / "without_frames.h5", tmp_path / "train.h5")
    write_recording(sources[0], replace(example(), frames=None, coupon=None))
    write_small_bench(tmp_path)
    file, processes = scheduler

    def written(folder, pieces, cluster):
        folders = tuple(tmp_path / folder / source.stem for source in sources)
        kept = (tmp_path / folder / name for name in ("conf", "calibrate"))
        said = dict(cluster.spread(pieces(sources, folders, *kept, "fast", Criteria()), range(2)))
        assert said[0].verdict == "cannot_tell"
        assert said[1].verdict == "no_mismatch"
        files = (path for path in (tmp_path / folder).rglob("*.*") if path.suffix != ".html")
        return {path.relative_to(tmp_path / folder): path.read_bytes() for path in files}

    by_threads = written("here", Diagnoses, LocalCluster(1))
    by_dask = written("there", DiagnosesKilledOnce, DaskCluster(json.loads(file.read_text())["address"]))
    assert (tmp_path / "died").exists()
    assert sum(process.poll() is None for process in processes) == 2
    assert by_dask == by_threads


def test_a_scheduler_that_is_not_there_is_said(tmp_path):
    pytest.importorskip("distributed", reason=WITHOUT_DASK)
    from ertskin.cluster.dask import DaskCluster
    from ertskin.errors import UserError

    with pytest.raises(UserError, match="no Dask scheduler answers"):
        as_dict(DaskCluster(address="tcp://127.0.0.1:1"))

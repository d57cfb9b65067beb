"""How many cores a process uses: those it was given, no more."""

from __future__ import annotations

import os
import threading

import pytest

from ertskin.cluster.local import LocalCluster
from ertskin.cores import SHARE_VARIABLE, given_cores, in_threads


def test_a_process_uses_the_cores_it_may_run_on(monkeypatch) -> None:
    monkeypatch.delenv(SHARE_VARIABLE, raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 3, 5}, raising=False)
    assert given_cores() == 3


def test_a_worker_uses_its_share(monkeypatch) -> None:
    monkeypatch.setenv(SHARE_VARIABLE, "7")
    assert given_cores() == 7


def cores_of(number: int) -> int:
    return given_cores()


def test_the_workers_of_a_cluster_share_what_there_is(monkeypatch) -> None:
    monkeypatch.setenv(SHARE_VARIABLE, "6")
    assert dict(LocalCluster(2).spread(cores_of, range(2))) == {0: 3, 1: 3}
    assert given_cores() == 6


@pytest.mark.parametrize("cores", ["1", "4"])
def test_results_come_in_order_from_as_many_threads_as_there_are_cores(monkeypatch, cores: str) -> None:
    monkeypatch.setenv(SHARE_VARIABLE, cores)
    together = threading.Barrier(int(cores))

    def work(item: int) -> int:
        together.wait(timeout=10)
        return item**2

    assert in_threads(work, iter(range(4))) == [0, 1, 4, 9]


def test_what_the_work_raises_is_raised(monkeypatch) -> None:
    monkeypatch.setenv(SHARE_VARIABLE, "2")
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda item: 1 // item, [1, 0])

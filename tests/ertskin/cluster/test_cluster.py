"""The same results wherever they are computed, also when a worker dies."""

import os
import signal

import numpy as np
import pytest

from ertskin.cluster import LocalCluster


def draw(number):
    return np.random.default_rng(number).standard_normal(3)


def fails(number):
    raise ValueError(f"no such piece: {number}")


class DiesOnce:
    """Kills its worker the first time piece 2 is asked for."""

    def __init__(self, marker):
        self.marker = marker

    def __call__(self, number):
        if number == 2 and not self.marker.exists():
            self.marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return draw(number)


def as_dict(cluster, compute=draw):
    return {number: value.tolist() for number, value in cluster.spread(compute, range(5))}


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_give_what_one_process_gives(workers):
    assert as_dict(LocalCluster(workers)) == {k: draw(k).tolist() for k in range(5)}


def test_a_workers_error_is_raised_here():
    with pytest.raises(ValueError, match="no such piece"):
        list(LocalCluster(2).spread(fails, range(3)))


def test_dask_gives_the_same_also_when_a_worker_is_killed(tmp_path):
    pytest.importorskip("distributed", reason="Dask is an extra: pip install 'ertskin[cluster]'")
    from ertskin.cluster.dask import DaskCluster

    assert as_dict(DaskCluster(workers=2), DiesOnce(tmp_path / "died")) == {k: draw(k).tolist() for k in range(5)}
    assert (tmp_path / "died").exists()


def test_a_scheduler_that_is_not_there_is_said(tmp_path):
    pytest.importorskip("distributed", reason="Dask is an extra: pip install 'ertskin[cluster]'")
    from ertskin.cluster.dask import DaskCluster
    from ertskin.errors import UserError

    with pytest.raises(UserError, match="no Dask scheduler answers"):
        as_dict(DaskCluster(address="tcp://127.0.0.1:1"))

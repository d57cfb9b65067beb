"""What the cluster's tests have computed elsewhere: a worker imports this file alone, which must load in a moment."""

import os
import resource
import signal

import numpy as np
from threadpoolctl import threadpool_info


def draw(number):
    return np.random.default_rng(number).standard_normal(3)


def openmp_threads(_number=0):
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "openmp"}


def fails(number):
    raise ValueError(f"no such piece: {number}")


def first(marker):
    """Whether this process is the one that made ``marker``: of two workers at the same moment, one."""
    try:
        marker.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


class DiesOnce:
    """Kills its worker the first time piece 2 is asked for."""

    def __init__(self, marker):
        self.marker = marker

    def __call__(self, number):
        if number == 2 and first(self.marker):
            os.kill(os.getpid(), signal.SIGKILL)
        return draw(number)


class PagesTouched:
    """How many pages the system hands out while an array of a megabyte is made and dropped again and again."""

    def __call__(self, number):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(50):
            np.ones(1 << 17)
        return np.array(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)


class AlwaysDies:
    """Kills its worker whenever it is asked for piece 2."""

    def __call__(self, number):
        if number == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return draw(number)


class Prepared:
    """Tells for each piece how often it was prepared, and whether that was in another process."""

    def __init__(self):
        self.prepared = []

    def prepare(self):
        self.prepared.append(os.getpid())

    def __call__(self, number):
        return np.array([len(self.prepared), self.prepared[0] != os.getpid()])


class Bowl:
    """A skin that is quick to simulate; kills its worker once, in the middle of a set."""

    def __init__(self, marker=None):
        self.marker = marker

    def change_ohm(self, contact_m, force_n):
        if self.marker is not None and (force_n > 5).any() and first(self.marker):
            os.kill(os.getpid(), signal.SIGKILL)
        force, place = np.nan_to_num(force_n), np.nan_to_num(contact_m)
        return np.stack([force.sum(axis=1), np.exp(-force * place[..., 0]).sum(axis=1), (force**2).sum(axis=1)], axis=1)

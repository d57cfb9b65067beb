"""Where independent pieces of work run: processes of this machine, Dask workers, a SLURM queue.

Every cluster has one method, ``spread(compute, numbers)``: yields ``(number, compute(number))`` as they are done, in
any order. ``compute`` must depend on its number alone, so results are the same wherever they ran. If it has a method
``prepare()``, that is called once before it is sent: what takes long to build is built here and travels with it.
"""

from ertskin.cluster.local import LocalCluster

__all__ = ["LocalCluster"]

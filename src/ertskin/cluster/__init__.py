"""Where independent pieces of work run: processes of this machine, Dask workers, a SLURM queue.

Every cluster has one method, ``spread(compute, numbers)``: yields ``(number, compute(number))`` as they are done, in
any order. ``compute`` must depend on its number alone, so results are the same wherever they ran.
"""

from ertskin.cluster.local import LocalCluster

__all__ = ["LocalCluster"]

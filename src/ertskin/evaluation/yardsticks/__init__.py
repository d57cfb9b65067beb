"""What a learned network has to beat: simple regressions, imaging, and the best the physics allows.

Every yardstick has ``name``, ``fit(change_v, force_map_n)`` and ``predict(change_v)``: from (N,P) whitened changes of
the reciprocal numbers in volt (touched minus rest, ``Protocol.whitened``) to (N,n) newton on the taxels.
"""

from ertskin.evaluation.yardsticks.gauss_newton_imaging import GaussNewtonImaging
from ertskin.evaluation.yardsticks.kernel_ridge import KernelRidge
from ertskin.evaluation.yardsticks.maximum_likelihood import MaximumLikelihood
from ertskin.evaluation.yardsticks.mean import Mean
from ertskin.evaluation.yardsticks.ridge import Ridge
from ertskin.evaluation.yardsticks.yardstick import Yardstick

__all__ = ["GaussNewtonImaging", "KernelRidge", "MaximumLikelihood", "Mean", "Ridge", "Yardstick"]

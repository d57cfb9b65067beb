"""The metrics of the design, one per file; each maps an ``Outcome`` to a ``Score``."""

from ertskin.evaluation.metrics.exact_rate_two import exact_rate_two
from ertskin.evaluation.metrics.force_correlation_one import force_correlation_one
from ertskin.evaluation.metrics.force_error_two import force_error_two_n
from ertskin.evaluation.metrics.force_rmse_one import force_rmse_one_n
from ertskin.evaluation.metrics.hit_rate_one import hit_rate_one
from ertskin.evaluation.metrics.location_error import location_error_mm
from ertskin.evaluation.metrics.score import Score

ONE_POINT = (hit_rate_one, force_rmse_one_n, force_correlation_one)
TWO_POINT = (exact_rate_two, force_error_two_n)

__all__ = [
    "ONE_POINT",
    "TWO_POINT",
    "Score",
    "exact_rate_two",
    "force_correlation_one",
    "force_error_two_n",
    "force_rmse_one_n",
    "hit_rate_one",
    "location_error_mm",
]

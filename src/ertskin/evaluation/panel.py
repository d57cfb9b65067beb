"""The yardsticks of every evaluation, from what the networks learned from and the physics it came from."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ertskin.data.material import Material
from ertskin.data.synthesis import Forward
from ertskin.errors import UserError
from ertskin.evaluation.benchmark import Lesson, TestFrames, bound_result, oracle_result, yardstick_result
from ertskin.evaluation.outcome import Array
from ertskin.evaluation.results import MethodResult
from ertskin.evaluation.yardsticks import GaussNewtonImaging, KernelRidge, MaximumLikelihood, Mean, Ridge
from ertskin.evaluation.yardsticks.forward import Response
from ertskin.evaluation.yardsticks.imaging_jacobian import imaging_jacobian
from ertskin.physics.conduction.sheet import Solution

YARDSTICKS = ("mean", "ridge", "kernel_ridge", "imaging", "oracle", "bound")
LEVELS = 24


def yardsticks(
    names: Sequence[str],
    material: Material,
    forward: Forward,
    rest: Callable[[], Solution],
    frames: TestFrames,
    seeds: Sequence[int],
    say: Callable[[str], None] = lambda name: None,
) -> list[MethodResult]:
    """Results of the yardsticks ``names`` on ``frames``; those with random parts or noisy lessons once per seed.

    ``forward`` gives the oracle its physics, ``rest`` the untouched sheet its Jacobian; either is asked only if needed.
    ``say`` gets each name before its turn. Raises ``UserError`` for an unknown name.
    """
    if unknown := set(names) - set(YARDSTICKS):
        raise UserError(f"no yardstick named {', '.join(sorted(unknown))}: choose from {', '.join(YARDSTICKS)}")
    lessons = {seed: Lesson.of(material, seed) for seed in seeds} if set(names) - {"oracle", "bound"} else {}
    response = Response(forward, material.protocol, material.taxel_m)
    covariance_v2 = _covariance_v2(material)

    def imaging() -> MethodResult:
        jacobian_v, pixel_m = imaging_jacobian(rest(), material.protocol)
        return yardstick_result(
            lambda seed: GaussNewtonImaging(jacobian_v, pixel_m, material.taxel_m),
            lessons,
            frames,
            "one step, then a curve per taxel",
        )

    def oracle() -> MaximumLikelihood:
        highest_n = 1.05 * material.trials.force_map_n.max()
        return MaximumLikelihood(response, covariance_v2, highest_n * (np.arange(LEVELS) + 1) / LEVELS)

    makers: dict[str, Callable[[], MethodResult]] = {
        "mean": lambda: yardstick_result(lambda seed: Mean(), lessons, frames, "always the mean map"),
        "ridge": lambda: yardstick_result(lambda seed: Ridge(), lessons, frames, "linear regression"),
        "kernel_ridge": lambda: yardstick_result(
            lambda seed: KernelRidge(seed=seed), lessons, frames, "Gaussian kernel, tuned on held-out forces"
        ),
        "imaging": imaging,
        "oracle": lambda: oracle_result(oracle(), frames, "most likely contacts under the calibrated physics"),
        "bound": lambda: bound_result(response, covariance_v2, frames),
    }
    results = []
    for name in (name for name in YARDSTICKS if name in names):
        say(name.replace("_", " "))
        results.append(makers[name]())
    return results


def _covariance_v2(material: Material) -> Array:
    """The noise's covariance; a floor of a thousandth of the signal's rms keeps a noise-free material usable."""
    covariance = np.array(material.noise.covariance_v2, dtype=float)
    some = material.trials[slice(None, None, 37)].coordinates_v(material.protocol)
    floor_v = 1e-3 * float(np.sqrt(np.mean(some**2)))
    return covariance + floor_v**2 * np.eye(len(covariance)) * (np.diag(covariance).min() < 1e-6 * floor_v**2)

"""From trials to a reconstruction: the denoiser where the model has one, then the network, or both side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from ertskin.data.material import Material
from ertskin.data.trials import TrialSet
from ertskin.errors import UserError
from ertskin.models.denoiser import Denoiser
from ertskin.models.network import Network
from ertskin.models.reconstruction import Reconstruction
from ertskin.training.child_process import trained_in_child
from ertskin.training.fit import Fitted
from ertskin.training.progress import Log
from ertskin.training.settings import TrainerSettings
from ertskin.training.stage import Stage

LogStage = Callable[[str, dict[str, float], int], None]


def train_reconstruction(
    material: Material,
    build_network: partial[Network],
    build_denoiser: partial[Denoiser] | None,
    settings: TrainerSettings,
    folder: Path,
    log: LogStage = lambda stage, metrics, epoch: None,
    start: Reconstruction | None = None,
) -> tuple[Reconstruction, dict[str, Fitted]]:
    """Train on ``material``; ``build_*`` are their classes, given all but ``inputs`` and ``taxel_m``.

    ``folder`` keeps one folder of checkpoints for each stage. ``log(stage, metrics, epoch)`` gets each epoch's losses.
    ``start``: of another specimen, whose weights training begins with; with ``max_epochs`` of 0 they are kept. Denoiser
    and network don't depend on one another: with two threads or more each gets a process and half of them.
    Raises ``UserError`` where the model has a denoiser and the material has nothing to train it on, or where it differs
    from the one it starts from.
    """
    readings, pairs = material.protocol.orthonormal.shape
    inputs = pairs if _class(build_network).reads == "coordinates" else readings
    build_network = partial(build_network, inputs=inputs, taxel_m=material.taxel_m.tolist())

    def stage(name: str, build: Callable[[], Network], trials: TrialSet, threads: int) -> Stage:
        chosen = replace(settings, threads=threads)
        begin = None if start is None else getattr(start, name)
        return Stage(name, build, material.protocol, trials, material.noise, chosen, folder, begin)

    def named(stage: str) -> Log:
        return lambda metrics, epoch: log(stage, metrics, epoch)

    if not settings.max_epochs:
        kept = stage("network", build_network, material.trials, settings.threads).recalibrated()
        return _reconstruction(material, kept, None), {}
    if build_denoiser is None:
        network, fitted = stage("network", build_network, material.trials, settings.threads).fit(named("network"))
        return _reconstruction(material, network, None), {"network": fitted}
    if material.denoiser is None:
        raise UserError("this model has a denoiser, and there are no denoiser trials to train it on")
    each = max(1, settings.threads // 2)
    first = stage("denoiser", partial(build_denoiser, inputs=readings), material.denoiser, each)
    second = stage("network", build_network, material.trials, each)
    if settings.threads > 1:
        network, of_network = _side_by_side(first, second, named)
        denoiser, of_denoiser = first.fit(named("denoiser"))
    else:
        denoiser, of_denoiser = first.fit(named("denoiser"))
        network, of_network = second.fit(named("network"))
    assert isinstance(denoiser, Denoiser)
    return _reconstruction(material, network, denoiser), {"denoiser": of_denoiser, "network": of_network}


def _side_by_side(in_child: Stage, in_parent: Stage, named: Callable[[str], Log]) -> tuple[Network, Fitted]:
    """Train both; what ``in_parent`` has become. Epochs of both are logged by this process."""
    with trained_in_child(in_child, named(in_child.name)) as log_epochs:

        def log_both(metrics: dict[str, float], epoch: int) -> None:
            log_epochs()
            named(in_parent.name)(metrics, epoch)

        return in_parent.fit(log_both)


def _reconstruction(material: Material, network: Network, denoiser: Denoiser | None) -> Reconstruction:
    return Reconstruction(material.protocol, network, denoiser, {"data_checksum": material.checksum})


def _class(build: partial[Network]) -> type[Network]:
    assert isinstance(build.func, type)
    return build.func

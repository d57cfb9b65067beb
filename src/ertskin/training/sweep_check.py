"""A sweep with a wrong value anywhere in it is refused before its first job begins."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.types import QuotedString
from hydra.experimental.callback import Callback
from omegaconf import OmegaConf, open_dict

from ertskin.errors import PastHydra, UserError
from ertskin.tracking.sweep import swept_overrides
from ertskin.training.request import check_settings

if TYPE_CHECKING:
    from omegaconf import DictConfig


class CheckedSweep(Callback):
    """Looks at every value that a sweep gives to a setting, and at the names it gives to groups, one by one."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Raises ``PastHydra`` from the ``UserError``: an ordinary exception of a callback is only warned of."""
        try:
            for override in swept_overrides(config.hydra):
                for value in override.sweep_iterator():
                    _check(config, override.get_key_element().lstrip("+~"), value)
        except UserError as error:
            raise PastHydra from error


def _check(config: DictConfig, key: str, value: Any) -> None:
    """``UserError`` where ``key`` can't be ``value``, whatever the rest of the sweep is."""
    if isinstance(value, QuotedString):
        value = value.text
    if names := _choices(config, key):
        if value not in names:
            raise UserError(f"no {key} is named '{value}': choose from {', '.join(sorted(names))}")
        return
    job = config.copy()
    with open_dict(job):
        OmegaConf.update(job, key, value)
    check_settings(job)
    if key.startswith("model."):
        from ertskin.training.job import built

        built(job.model)


def _choices(config: DictConfig, group: str) -> set[str]:
    """Names in a group: Hydra's own loader, once started, doesn't list those of the folders searched besides."""
    names = set(GlobalHydra.instance().config_loader().get_group_options(group))
    for folder in config.hydra.searchpath:
        names |= {path.stem for path in (Path(folder.removeprefix("file://")) / group).glob("*.yaml")}
    return names

"""Where the Hydra configuration lies, and the choices it offers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ertskin.errors import UserError

if TYPE_CHECKING:
    from omegaconf import DictConfig


def config_dir() -> Path:
    """Absolute path of the configuration: inside the installed package, or at the root of a checkout."""
    package = Path(__file__).resolve().parent
    for folder in (package / "conf", package.parents[1] / "conf"):
        if folder.is_dir():
            return folder
    raise UserError(f"the configuration is missing beside {package}: install ertskin again")


def choices(group: str) -> list[str]:
    """Names that may follow ``group=`` on the command line, sorted."""
    return sorted(path.stem for path in (config_dir() / group).glob("*.yaml"))


def whole_number(config: DictConfig, key: str) -> int:
    """``config.key`` where it is a whole number, else a ``UserError`` that names it."""
    value = config[key]
    if isinstance(value, bool) or not isinstance(value, int):
        raise UserError(f"{key} must be a whole number, not {value!r}")
    return value

"""Where the Hydra configuration lies, and the choices it offers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ertskin.errors import UserError


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


def groups(verb: str) -> dict[str, str | None]:
    """Group -> the choice a command makes by itself; None where it makes none."""
    found: dict[str, str | None] = {}
    for entry in _loaded(config_dir() / f"{verb}.yaml").get("defaults", []):
        for group, default in entry.items() if isinstance(entry, dict) else ():
            name, _, package = str(group).removeprefix("override ").lstrip("/").partition("@")
            name = name.removeprefix("optional ")
            # Another use of a group than the one that bears its name.
            if package and name in found:
                continue
            if choices(name):
                found[name] = None if default is None else str(default)
    return found


def settings(name: str, choice: str | None = None) -> list[str]:
    """Names of the settings of a command, or of one ``choice`` of the group ``name``, those it builds on included."""
    path = config_dir() / f"{name}.yaml" if choice is None else config_dir() / name / f"{choice}.yaml"
    if not path.is_file():
        return []
    loaded = _loaded(path)
    bases = [entry for entry in loaded.get("defaults", []) if isinstance(entry, str) and entry != "_self_"]
    inherited = [key for base in bases if choice is not None for key in settings(name, base)]
    own = [key for key in loaded if key not in ("defaults", "hydra") and not key.startswith("_")]
    return list(dict.fromkeys([*inherited, *own]))


def _loaded(path: Path) -> dict[str, Any]:
    import yaml

    return yaml.safe_load(path.read_text(encoding="utf-8")) or {}

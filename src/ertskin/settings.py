"""Settings with types and limits, checked before anything heavy is loaded: a wrong one is refused in one line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, field, fields
from typing import Any, TypeVar, get_args, get_type_hints

from ertskin.errors import UserError

Settings = TypeVar("Settings")
KINDS = {int: "a whole number", float: "a number", bool: "true or false", str: "text"}


def limited(default: Any, about: object = None, **limits: Any) -> Any:
    """A dataclass's field that is ``above``, at ``least`` or at ``most`` some number, or ``one_of`` several words.

    ``about``: what documentation says of it, kept with the field.
    """
    return field(default=default, metadata={"limits": limits, "about": about})


def limits_of(setting: Field[Any]) -> Mapping[str, Any]:
    """The limits of a dataclass's field, none where it wasn't made by ``limited``."""
    return setting.metadata.get("limits", {})


def checked(kind: type[Settings], section: Any, name: str) -> Settings:
    """The section ``name`` of a configuration as the dataclass ``kind``; ``UserError`` names what is wrong with it."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException, ValidationError

    try:
        values = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(kind), section))
    except ValidationError as error:
        raise UserError(_wrong_type(kind, section, name, str(error.full_key))) from None
    except OmegaConfBaseException as error:
        known = ", ".join(each.name for each in fields(kind))  # type: ignore[arg-type]
        raise UserError(f"no setting '{name}.{error.full_key}': choose from {known}") from None
    for each in fields(kind):  # type: ignore[arg-type]
        check_limits(getattr(values, each.name), limits_of(each), f"{name}.{each.name}")
    return values  # type: ignore[return-value]


def whole_number(value: Any, name: str, **limits: int) -> int:
    """``value`` where it is a whole number within ``limits``, as ``limited`` takes them; else a ``UserError``."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise UserError(f"{name} must be a whole number, not {value!r}")
    check_limits(value, limits, name)
    return value


def check_limits(value: Any, limits: Mapping[str, Any], name: str) -> None:
    """Raise ``UserError`` where ``value`` isn't within ``limits``, as ``limited`` takes them, or isn't finite."""
    if value is None:
        return
    wrong = {
        "above": lambda limit: not value > limit,
        "least": lambda limit: not value >= limit,
        "most": lambda limit: not value <= limit,
        "one_of": lambda limit: value not in limit,
    }
    words = {"above": "above {}", "least": "at least {}", "most": "at most {}", "one_of": "one of {}"}
    for limit, bound in limits.items():
        if wrong[limit](bound):
            allowed = ", ".join(bound) if limit == "one_of" else bound
            raise UserError(f"{name} must be {words[limit].format(allowed)}, not {value}")
    if isinstance(value, float) and not math.isfinite(value):
        raise UserError(f"{name} must be finite, not {value}")


def check_arguments(target: type, arguments: Mapping[str, Any], name: str) -> None:
    """Raise ``UserError`` where an argument isn't of the simple type that ``target`` declares for it."""
    hints = get_type_hints(target.__init__)  # type: ignore[misc]
    for key, value in arguments.items():
        if key not in hints:
            known = ", ".join(each for each in hints if each != "return")
            raise UserError(f"no setting '{name}.{key}': choose from {known}")
        wanted = hints[key]
        fits = isinstance(value, (int, float) if wanted is float else wanted) if wanted in KINDS else True
        if not fits or (isinstance(value, bool) and wanted in (int, float)):
            raise UserError(f"{name}.{key} must be {KINDS[wanted]}, not {value!r}")


def _wrong_type(kind: type, section: Any, name: str, key: str) -> str:
    hint = get_type_hints(kind)[key]
    wanted = next((KINDS[each] for each in (hint, *get_args(hint)) if each in KINDS), "another kind of value")
    return f"{name}.{key} must be {wanted}, not {section[key]!r}"

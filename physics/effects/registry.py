"""Effects by name: every module of this package that defines one is found, so adding a file adds an effect."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from ertskin.physics import effects
from ertskin.physics.effects.effect import Effect, Stage, shown_by
from ertskin.physics.effects.hypothesis import Measured, Signal


@cache
def effect_classes() -> dict[str, type[Effect]]:
    """Every effect by its name, in the order of the stages and then of the alphabet."""
    found: dict[str, type[Effect]] = {}
    for module in pkgutil.iter_modules(effects.__path__):
        loaded = importlib.import_module(f"{effects.__name__}.{module.name}")
        for value in vars(loaded).values():
            if isinstance(value, type) and issubclass(value, Effect) and "name" in vars(value):
                found[value.name] = value
    stages = list(Stage)
    return dict(sorted(found.items(), key=lambda item: (stages.index(item[1].stage), item[0])))


def effects_shown_by(signal: Signal) -> list[type[Effect]]:
    """The effects that a signal shows."""
    return [kind for kind in effect_classes().values() if shown_by(kind, signal)]


def measured_as(quantity: Measured) -> type[Effect]:
    """The effect that a quantity measured directly is, raises ``KeyError`` where there is none."""
    return {kind.hypothesis.measured: kind for kind in effect_classes().values()}[quantity]


def build_effects(config: Mapping[str, Any]) -> tuple[Effect, ...]:
    """Effects from ``{name: {parameter: value}}``; a list of such settings repeats an effect (two bad electrodes).

    Raises ``ValueError`` on a name or parameter that doesn't exist and on a value out of range.
    """
    built: list[Effect] = []
    for name, settings in config.items():
        if name not in effect_classes():
            raise ValueError(f"no effect named {name!r}; there are {', '.join(effect_classes())}")
        repeated = settings if isinstance(settings, Sequence) and not isinstance(settings, str) else [settings]
        built.extend(_build(name, dict(one or {})) for one in repeated)
    return tuple(built)


def _build(name: str, settings: dict[str, Any]) -> Effect:
    kind = effect_classes()[name]
    try:
        return kind(**{key: _tuple(value) for key, value in settings.items()})
    except TypeError as error:
        raise ValueError(f"effect {name}: {str(error).split('__init__() ')[-1]}") from None


def _tuple(value: Any) -> Any:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(_tuple(v) for v in value)
    return value


def effects_config(effects: Sequence[Effect]) -> dict[str, Any]:
    """The inverse of ``build_effects``."""
    config: dict[str, Any] = {}
    for effect in effects:
        if effect.name in config:
            earlier = config[effect.name]
            config[effect.name] = [*(earlier if isinstance(earlier, list) else [earlier]), effect.settings()]
        else:
            config[effect.name] = effect.settings()
    return config

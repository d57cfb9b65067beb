"""From a plan's configuration to the presses it stands for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from yaml import YAMLError

from ertskin.errors import UserError
from ertskin.hardware.plan import (
    WEIGHT_N,
    Plan,
    PlanError,
    anywhere_test,
    one_point_test,
    pairs_of,
    plan_from_presses,
    plan_of,
    repeated,
    taxel_plan,
    two_point_test,
)
from ertskin.physics.sensor import Sensor

KINDS: Mapping[str, Callable[[Mapping[str, Any], Sensor], Plan]] = {
    "taxels": lambda fields, sensor: taxel_plan(sensor.taxel_m, **fields.get("ramp", {})),
    "one_point_test": lambda fields, sensor: one_point_test(sensor.taxel_m, **fields.get("depths", {})),
    "two_point_test": lambda fields, sensor: two_point_test(
        sensor.taxel_m,
        pairs_of(sensor.taxel_m) if fields.get("pairs") is None else fields["pairs"],
        fields.get("weight_n", WEIGHT_N),
    ),
    "anywhere_test": lambda fields, sensor: anywhere_test(
        sensor.extent_m, **{key: value for key, value in fields.items() if key not in ("kind", "repeats")}
    ),
    "file": lambda fields, sensor: _plan_in(Path(fields["path"]), sensor),
    "listed": lambda fields, _sensor: plan_of(fields),
}
"""Makers of plans, by the ``kind`` of a plan's configuration."""


def diagnosis_asking(fields: Mapping[str, Any]) -> dict[str, Any] | None:
    """The diagnosis whose next press a configuration's ``plan`` is; None for any other plan.

    Raises ``UserError`` for a file that can't be read.
    """
    held = _held_in(Path(fields["path"])) if fields.get("kind") == "file" else {}
    return held if "next_press" in held else None


def chosen_plan(fields: Mapping[str, Any], sensor: Sensor) -> Plan:
    """The plan a configuration's ``plan`` describes; raises ``UserError``."""
    kind = fields.get("kind", "listed")
    if kind not in KINDS:
        raise UserError(f"plan: no kind {kind!r}; choose one of {', '.join(KINDS)}")
    if kind not in ("listed", "file") and not len(sensor.taxel_m):
        raise UserError(f"plan: {kind} needs a sensor with taxels")
    try:
        plan = KINDS[kind](fields, sensor)
        return repeated(plan, int(fields.get("repeats", 1)))
    except PlanError as error:
        raise UserError(f"plan: {error}") from None
    except (KeyError, TypeError, IndexError) as error:
        raise UserError(f"plan {kind}: {type(error).__name__} {error}") from None


def _plan_in(path: Path, sensor: Sensor) -> Plan:
    """The plan a YAML file describes as those in ``conf/plan`` do, or the one a ``diagnosis.json`` asks for."""
    fields = _held_in(path)
    if "next_press" not in fields:
        return chosen_plan({"name": path.stem, **fields}, sensor)
    wanted = fields["next_press"]
    if not isinstance(wanted, dict):
        raise UserError(f"{path}: asks for no next press")
    return plan_from_presses(wanted.get("press"), _named(wanted))


def _held_in(path: Path) -> dict[str, Any]:
    from omegaconf import OmegaConf

    try:
        # JSON is YAML; OmegaConf reads 1e-05 as a number, which plain YAML does not.
        fields = OmegaConf.to_container(OmegaConf.load(path), resolve=True)
    except (OSError, ValueError, YAMLError) as error:
        raise UserError(f"{path}: {error}") from None
    if not isinstance(fields, dict):
        raise UserError(f"{path}: found no plan, expected a list of presses or a diagnosis")
    return {str(key): value for key, value in fields.items()}


def _named(wanted: Mapping[str, Any]) -> str:
    between = wanted.get("between") or []
    return f"next_press, to tell {' from '.join(map(str, between))}" if between else "next_press"

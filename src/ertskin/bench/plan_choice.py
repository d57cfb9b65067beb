"""From a plan's configuration to the presses it stands for."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ertskin.errors import UserError
from hardware.plan import (
    Plan,
    PlanError,
    next_press_plan,
    one_point_test,
    plan_of,
    repeated,
    taxel_plan,
    two_point_test,
)
from physics.sensor import Sensor

KINDS: Mapping[str, Callable[[Mapping[str, Any], Sensor], Plan]] = {
    "taxels": lambda fields, sensor: taxel_plan(sensor.taxel_m, **fields.get("ramp", {})),
    "one_point_test": lambda fields, sensor: one_point_test(sensor.taxel_m, **fields.get("depths", {})),
    "two_point_test": lambda fields, sensor: two_point_test(sensor.taxel_m, fields["pairs"], fields["weight_n"]),
    "next_press": lambda fields, _sensor: _asked_for(Path(fields["diagnosis"])),
    "listed": lambda fields, _sensor: plan_of(fields),
}
"""Makers of plans, by the ``kind`` of a plan's configuration."""


def chosen_plan(fields: Mapping[str, Any], sensor: Sensor) -> Plan:
    """The plan a configuration's ``plan`` describes; raises ``UserError``."""
    kind = fields.get("kind", "listed")
    if kind not in KINDS:
        raise UserError(f"plan: no kind {kind!r}; choose one of {', '.join(KINDS)}")
    if kind not in ("listed", "next_press") and not len(sensor.taxel_m):
        raise UserError(f"plan: {kind} needs a sensor with taxels")
    try:
        plan = KINDS[kind](fields, sensor)
        return repeated(plan, int(fields.get("repeats", 1)))
    except PlanError as error:
        raise UserError(f"plan: {error}") from None
    except (KeyError, TypeError, IndexError) as error:
        raise UserError(f"plan {kind}: {type(error).__name__} {error}") from None


def _asked_for(diagnosis: Path) -> Plan:
    try:
        verdict = json.loads(diagnosis.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(f"{diagnosis}: {error}") from None
    wanted = verdict.get("next_press") if isinstance(verdict, dict) else None
    if not isinstance(wanted, dict):
        raise UserError(f"{diagnosis}: asks for no next press")
    return next_press_plan(wanted)

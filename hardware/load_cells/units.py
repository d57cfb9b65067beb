"""Units of force that load cells write behind their values."""

from __future__ import annotations

STANDARD_GRAVITY = 9.80665
"""m/s2, exact by definition (3rd CGPM, 1901)."""

NEWTON_PER_UNIT = {
    "N": 1.0,
    "mN": 1e-3,
    "kN": 1e3,
    "g": 1e-3 * STANDARD_GRAVITY,
    "gF": 1e-3 * STANDARD_GRAVITY,
    "kg": STANDARD_GRAVITY,
    "kgF": STANDARD_GRAVITY,
    "lb": 0.45359237 * STANDARD_GRAVITY,
    "lbs": 0.45359237 * STANDARD_GRAVITY,
    "lbF": 0.45359237 * STANDARD_GRAVITY,
    "oz": 0.028349523125 * STANDARD_GRAVITY,
    "ozF": 0.028349523125 * STANDARD_GRAVITY,
}
"""Newton per unit, by the unit's name as instruments write it."""

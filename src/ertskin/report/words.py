"""Names of parameters and effects as a person reads them."""

from __future__ import annotations

SUFFIXES = ("_n_per_m", "_per_pa", "_per_k", "_pa", "_m", "_s", "_v", "_n", "_ohm", "_deg")
"""Units at the end of a parameter's name; the number bears its own."""
SCALED = {"m": (1e3, "mm"), "V": (1e3, "mV")}


def words_of(name: str) -> str:
    """A name as words, the unit at its end left out."""
    for suffix in SUFFIXES:
        name = name.removesuffix(suffix)
    return name.replace("_", " ")


def name_in_words(name: str) -> str:
    """A name without a unit, a layer's for one, as words."""
    return name.replace("_", " ")


def force_in_words(force_n: float) -> str:
    """A force in newton, in millinewton where it is small."""
    return f"{force_n:.3g} N" if abs(force_n) >= 0.1 else f"{1e3 * force_n:.3g} mN"


def chance_in_words(chance: float) -> str:
    """A probability; one that is too small for a number is none."""
    return f"{chance:.2g}" if chance > 0 else "< 1e-300"


def confidence_in_words(named: float, both: float, everywhere: float) -> str:
    """How sure a name is and, where these are other numbers, how sure name and map are where the map is determined, and
    over the whole sheet."""
    first, second, third = f"{named:.2f}", f"{both:.2f}", f"{everywhere:.2f}"
    with_map = first if first == second == third else f"{first}, with its map {second}"
    return with_map if second == third else f"{with_map} ({third} over the whole sheet)"


def interval(value: float, low: float, high: float, unit: str) -> str:
    """A value with its interval, in the unit people use."""
    factor, shown = SCALED.get(unit, (1.0, "" if unit == "1" else unit))
    numbers = (f"{factor * number:.3g}" for number in (value, low, high))
    return "{} {unit} ({} to {})".format(*numbers, unit=shown).replace("  ", " ")

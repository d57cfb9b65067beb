"""Forms of one effect: what tells them apart, and which are freer than the one at hand."""

from __future__ import annotations

from dataclasses import replace

from ertskin.diagnosis.voltage_fit import Term
from physics.effects.contact_pressure_dependence import ContactPressureDependence
from physics.effects.piezo_creep import PiezoCreep
from physics.effects.piezo_hysteresis import PiezoHysteresis
from physics.effects.scan_skew import ScanSkew


def form_of(term: Term) -> tuple[object, ...]:
    """What tells one form of an effect from another: what is free, what it remembers, whether it is a smooth field."""
    flags = (getattr(term.effect, flag, False) for flag in ("remembers_air", "multiplies"))
    return term.free, *flags, bool(getattr(term.effect, "nodes", ()))


def freer(term: Term) -> list[Term]:
    """The term with more of its form free, or in its other form; none where there is no more to free."""
    effect = term.effect
    if isinstance(effect, PiezoHysteresis) and term.free == ("width",):
        return [Term(effect.changed({"spread": 0.3}), ("width", "spread"))]
    if isinstance(effect, PiezoCreep) and not {"exponent", "half_pa"} & set(term.free):
        spread = effect
        if effect.decades == 0:
            spread = replace(effect, time_s=max(0.1 * effect.time_s, 0.1), decades=3.0, remembers_air=True)
        added = replace(spread, exponent=0.8, multiplies=False)
        return [
            Term(added, ("fraction", "time_s", "decades", "exponent")),
            Term(replace(spread, multiplies=True), ("fraction", "time_s", "decades", "half_pa")),
        ]
    if isinstance(effect, PiezoCreep) and "half_pa" in term.free and "power" not in term.free:
        return [Term(effect.changed({"unevenness": 0.3}), (*term.free, "unevenness", "power"))]
    if isinstance(effect, ContactPressureDependence) and "fixed_share" not in term.free:
        return [Term(effect.changed({"bend": 1.0, "fixed_share": 0.2}), (*term.free, "fixed_share"))]
    if isinstance(effect, ScanSkew) and "ease" not in term.free:
        eased = replace(effect, ease=0.5)
        return [Term(form, (*term.free, "ease")) for form in (eased, replace(eased, overshoots=True))]
    return []

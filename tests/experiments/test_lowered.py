"""Claims that rules made less sure, counted by rule and by what they are."""

from __future__ import annotations

from typing import Any

from judged import Judged
from lowered import Lowered, lowered, measured, without


def case(*claims: tuple[str, str, float]) -> Judged:
    """One that hides creep, and says these names, each lowered from 1 by a rule."""
    said: list[dict[str, Any]] = [
        {"name": name, "confidence": after, "reasons": [{"rule": rule, "before": 1.0, "after": after}]}
        for name, rule, after in claims
    ]
    hidden = {"name": "piezo_creep", "listed": True, "details": {}}
    return Judged("c000", {"kind": "single", "effects": [hidden]}, {"verdict": "explained", "effects": said})


def test_claims_are_counted_by_rule_kind_and_whether_they_were_right() -> None:
    found = lowered([
        case(("piezo_creep", "mending", 0.5), ("contact_drift", "mending", 0.5), ("contact_drift", "mending", 0.4)),
        case(("piezo_creep", "mending", 0.5), ("piezo_inhomogeneity", "left_over", 0.5)),
    ])  # fmt: skip
    assert found == {
        ("mending", "others"): [Lowered(0, True, 0.5, 0.99), Lowered(1, True, 0.5, 0.99)],
        ("mending", "contacts that wander"): [Lowered(0, False, 0.5, 0.99), Lowered(0, False, 0.4, 0.99)],
        ("left_over", "fields"): [Lowered(1, False, 0.5, 0.99)],
    }


def test_what_a_claim_would_be_without_a_rule_keeps_what_the_others_took() -> None:
    reasons = [
        {"rule": "rivals", "before": 1.0, "after": 0.8},
        {"rule": "left_over", "before": 0.8, "after": 0.4},
        {"rule": "mending", "before": 0.4, "after": 0.2},
    ]
    one = case(("piezo_creep", "", 0.2))
    one.diagnosis["effects"][0]["reasons"] = reasons
    found = {rule: claims[0] for (rule, _), claims in lowered([one]).items()}
    assert {claim.said for claim in found.values()} == {0.2}
    each = {rule: round(claim.without, 3) for rule, claim in found.items()}
    assert each == {"rivals": 0.25, "left_over": 0.4, "mending": 0.4}


def test_a_power_is_taken_of_what_a_rule_before_it_leaves_and_nought_leaves_what_stood_before() -> None:
    reasons = [
        {"rule": "rivals", "before": 1.0, "after": 0.9},
        {"rule": "left_over", "before": 0.9, "after": 0.8},
        {"rule": "maps", "before": 0.8, "after": 0.328},
        {"rule": "map_known", "before": 0.328, "after": 0.0},
    ]
    assert without(reasons, 3) == 0.328
    assert without(reasons[:3], 1) == 0.9**5
    assert without(reasons[:3], 2) == 0.8


def test_a_rule_that_took_nothing_is_not_counted() -> None:
    assert lowered([case(("piezo_creep", "left_over", 1.0))]) == {}


def test_what_is_measured_counts_by_recordings_unless_a_rule_lowered_it() -> None:
    contacts = case(("contact_drift", "rivals", 0.85), ("contact_drift", "rivals", 0.85))
    doubted = case(("contact_drift", "left_over", 0.4), ("piezo_creep", "rivals", 0.99))
    assert measured([contacts, doubted]) == (0, 1)
    limit = {"name": "adc_saturation", "confidence": 0.97, "parameters": {"limit_v": {}}}
    hidden = {"name": "adc_saturation", "listed": True, "details": {}}
    truth = {"kind": "single", "effects": [hidden]}
    assert measured([Judged("c001", truth, {"verdict": "explained", "effects": [limit]})]) == (1, 0)


def test_a_recording_of_which_some_contacts_were_wrong_is_not_right() -> None:
    claims = [
        {"name": "contact_drift", "confidence": 0.95, "parameters": {"electrode": {"value": number}}}
        for number in (1, 2)
    ]
    hidden = {"name": "contact_drift", "listed": True, "details": {"electrodes": [1]}}
    truth = {"kind": "single", "effects": [hidden]}
    assert measured([Judged("c001", truth, {"verdict": "explained", "effects": claims})]) == (0, 1)


def test_a_map_is_judged_as_its_claim_s_confidence_says_it() -> None:
    point = [[float(k), float(k % 3)] for k in range(9)]
    value = [0.0, 0.1, 0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 0.0]
    taxels = {"point_m": point, "value": value, "determined": [k < 5 for k in range(9)]}
    true = [0.0, 0.1, 0.2, 0.3, 0.4, -3.0, 3.0, -3.0, 3.0]
    hidden = {"name": "piezo_inhomogeneity", "listed": True, "details": {"map": true}}
    said = {
        "name": "piezo_inhomogeneity",
        "confidence": 0.5,
        "map": {"point_m": point, "value": value, "taxels": taxels},
        "reasons": [{"rule": "map_known", "before": 1.0, "after": 0.5}],
    }
    for more, right in (({}, False), ({"confidence_everywhere": 0.1}, True)):
        truth = {"kind": "single", "effects": [hidden], "point_m": point}
        one = Judged("c000", truth, {"verdict": "explained", "effects": [said | more]})
        assert lowered([one]) == {("map_known", "fields"): [Lowered(0, right, 0.5, 0.99)]}

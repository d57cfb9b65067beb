"""What tanks show in which nothing, or something known, is wrong: where thresholds and confidence come from.

    python experiments/real/ottawa/nulls.py [OUT]

Every case is simulated by ``simulated.py`` and measured by the diagnosis's own parts, before any threshold on places.
What is learned from cases with even numbers is judged on odd ones. Writes OUT/cases.json, this folder's by default.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from cases import KINDS, NULLS, case, seen
from numpy.typing import NDArray
from scipy.stats import gumbel_r, norm
from simulated import ELECTRODES, hand_made

from ertskin.diagnosis.criteria import DEFAULT
from ertskin.diagnosis.tank.displaced_electrodes import FLOOR, HANDS, OWN
from ertskin.diagnosis.tank.electrode_error import channel_weights, column_errors, rms_v
from ertskin.diagnosis.tank.placement import NEEDED, TOLERANCE
from ertskin.files import write_whole

Array = NDArray[np.float64]

COUNT = dict(zip(KINDS, (120, 60, 40, 80, 40, 40), strict=True))
INSTRUMENTS = 120
GOOD = 1e-3
"""Spread of the channels' gains and of the currents in an instrument that nobody would call faulty."""


def main() -> None:
    """Simulate all cases, write them, and say what follows from them."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    found = []
    for number in range(max(COUNT.values())):
        for kind in (kind for kind in KINDS if number < COUNT[kind]):
            found.append({"kind": kind, "number": number, **seen(case(kind, number))})
        print(f"{number + 1} of {max(COUNT.values())}", flush=True)
    write_whole(out / "cases.json", json.dumps(_rounded(found)) + "\n")
    write_whole(out / "instruments.json", json.dumps(_rounded(good_instruments())) + "\n")
    print(json.dumps(summary(found), indent=1))


def good_instruments() -> dict[str, list[float]]:
    """What a good instrument's scan shows: what no network explains over the readings' rms, and the largest gain or
    offset (over that rms) that any of its channels seems to have."""
    shown: dict[str, list[float]] = {"unexplained": [], "largest": []}
    for number in range(INSTRUMENTS):
        noise = float(10 ** np.random.default_rng([number, 11]).uniform(-4, -3))
        made = replace(hand_made(50000 + number), gain=GOOD, noise=noise).recording(frames=1)
        assert made.protocol is not None
        assert made.frames is not None
        protocol = made.protocol
        scan = protocol.filled(made.frames.voltage_v[0].astype(float))
        size = float(np.sqrt(np.mean(scan[protocol.taken] ** 2)))
        shown["unexplained"].append(rms_v(protocol, scan) / size)
        columns = [c for k in range(ELECTRODES) for c in column_errors(protocol, scan, channel_weights(protocol, k))]
        shown["largest"].append(max(max(abs(c.gain), abs(c.offset_v) / size) for c in columns))
    return shown


def numbers(values: list[Any]) -> Array:
    """(n,) numbers, NaN for null."""
    return np.array([np.nan if v is None else v for v in values], dtype=float)


def displaced(one: dict[str, Any], tolerance: float = TOLERANCE) -> list[int]:
    """The electrodes that the diagnosis calls out of place."""
    shift, error = numbers(one["shift"]), numbers(one["error"])
    if one["before"] < NEEDED * one["after"]:
        return []
    return [int(k) for k in np.flatnonzero(np.nan_to_num(np.abs(shift) - 2 * error) > tolerance)]


def confidence(shift: Array, error: Array) -> Array:
    """(n,) as ``displaced_electrodes`` has it, everything over the radius."""
    sigma = np.hypot(OWN * error, FLOOR)
    return np.minimum(norm.cdf((np.abs(shift) - HANDS) / sigma), DEFAULT.surest_confidence)


def spread(found: list[dict[str, Any]]) -> dict[str, float]:
    """``OWN`` and ``FLOOR``: the factor on a shift's standard error, and what is added to it, that make errors of the
    cases one standard deviation wide (maximum likelihood of a Student t of four degrees on a grid)."""
    off = np.concatenate([numbers(one["shift"]) - np.array(one["true_shift"]) for one in found])
    error = np.concatenate([numbers(one["error"]) for one in found])
    known = np.isfinite(off)
    off, error = off[known], error[known]
    best: tuple[float, float, float] = (np.inf, 0.0, 0.0)
    for own in np.arange(0.5, 4.01, 0.1):
        for floor in np.arange(0.0, 0.0201, 0.0005):
            sigma = np.hypot(own * error, max(floor, 1e-5))
            cost = float(np.sum(np.log(sigma) + 2.5 * np.log1p((off / sigma) ** 2 / 4)))
            best = min(best, (cost, float(own), float(floor)))
    return {
        "own": best[1],
        "floor": best[2],
        "within_two": float((np.abs(off) < 2 * np.hypot(best[1] * error, best[2])).mean()),
    }


def largest(one: dict[str, Any]) -> float:
    """Largest shift, over the radius, two standard errors taken off."""
    return float(np.nanmax(np.abs(numbers(one["shift"])) - 2 * numbers(one["error"])))


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """The rows of the README's table, from cases with odd numbers, and the constants from those with even ones."""
    even = [one for one in found if one["number"] % 2 == 0]
    odd = [one for one in found if one["number"] % 2 == 1]
    nulls = np.array([largest(one) for one in even if one["kind"] in NULLS])
    rows = {}
    for kind in KINDS:
        mine = [one for one in odd if one["kind"] == kind]
        row = {"cases": len(mine), "named": sum(bool(displaced(one)) for one in mine)}
        row["off_rms"] = float(
            np.sqrt(np.nanmean([np.nanmean((numbers(o["shift"]) - o["true_shift"]) ** 2) for o in mine]))
        )
        row["fault_blamed"] = sum(right_fault(one) for one in mine)
        row["wrongly_blamed"] = sum(bool(one["blamed"]) and not right_fault(one) for one in mine)
        rows[kind] = row
    return {
        "nulls_largest": np.quantile(nulls, [0.5, 0.95, 0.99, 1.0]).round(4).tolist(),
        "chance_beyond_tolerance": float(gumbel_r.sf(TOLERANCE, *gumbel_r.fit(nulls))),
        "spread": spread(even),
        "rows": rows,
        "power": power(odd),
        "reliability": reliability(odd),
    }


def right_fault(one: dict[str, Any]) -> bool:
    """Whether the channel, or an electrode of the channel, that is wrong is blamed."""
    wrong = one["fault"]
    if wrong < 0:
        return False
    if one["blamed_channels"]:
        return wrong in one["blamed"] or (wrong - 1) % ELECTRODES in one["blamed"]
    return wrong in one["blamed"] or (wrong + 1) % ELECTRODES in one["blamed"]


def power(found: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Share of tanks called out of shape by the largest true shift over the radius."""
    edges = [0.0, 0.05, 0.075, 0.1, 0.125, 0.15, 0.2, 0.4]
    true = np.array([np.abs(one["true_shift"]).max() for one in found])
    said = np.array([bool(displaced(one)) for one in found])
    return [
        {"from": a, "to": b, "cases": int(inside.sum()), "named": int(said[inside].sum())}
        for a, b in pairwise(edges)
        if (inside := (true >= a) & (true < b)).any()
    ]


def reliability(found: list[dict[str, Any]]) -> dict[str, float]:
    """Claims, how sure they are on average, and how many are of electrodes that are beyond what hands leave."""
    sure, right = [], []
    for one in found:
        shift, error, true = numbers(one["shift"]), numbers(one["error"]), np.array(one["true_shift"])
        for k in displaced(one):
            sure.append(float(confidence(shift[k : k + 1], error[k : k + 1])[0]))
            right.append(bool(abs(true[k]) > HANDS and np.sign(true[k]) == np.sign(shift[k])))
    return {"claims": len(sure), "mean_confidence": float(np.mean(sure)), "right": float(np.mean(right))}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(v) for v in value]
    if isinstance(value, float):
        return None if not np.isfinite(value) else float(f"{value:.4g}")
    return value.item() if isinstance(value, np.generic) else value


if __name__ == "__main__":
    main()

"""What to do to the skin: presses, one after another, each a row of steps. SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.history import Phase

Array = NDArray[np.float64]

WEIGHT_N = 0.5 * 9.80665
"""The paper's two-point test: weights of 500 g, placed by hand (IV-D)."""


PAIRS = (
    *((0, 35), (7, 28), (2, 14), (5, 30), (8, 22), (13, 16), (1, 33)),
    *((19, 23), (10, 25), (4, 26), (12, 17), (20, 32), (6, 11), (3, 27)),
)
"""Pairs of the paper's 36 taxels for its two-point test, as many as it has (IV-D); which ones it had is assumed."""
PERIOD_S = 0.5
"""The paper's 2 Hz."""
FINEST_STEP_M = 1e-4


class PlanError(ValueError):
    """A plan that can't be carried out: one line saying which entry and why."""


@dataclass(frozen=True)
class Step:
    """Go to a depth, wait, take ``frames`` frames. A depth of None leaves the stage where it is."""

    phase: Phase
    depth_m: float | None
    frames: int = 1
    wait_s: float = 0.0


@dataclass(frozen=True)
class Press:
    """One press: where, how, and the rest before it. With ``weight_n`` somebody places weights instead of the stage."""

    contact_m: tuple[tuple[float, float], ...]
    steps: tuple[Step, ...]
    rest_frames: int = 1
    rest_s: float = 5.0
    speed_m_s: float = 1e-3
    weight_n: float | None = None

    @property
    def depth_m(self) -> float:
        """The deepest step."""
        return max((step.depth_m or 0.0 for step in self.steps), default=0.0)

    @property
    def frames(self) -> int:
        """Frames, those at rest before it included."""
        return self.rest_frames + sum(step.frames for step in self.steps)


@dataclass(frozen=True)
class Plan:
    """Presses in order, frames every ``period_s``. ``first``: number of the first one, others were made before."""

    name: str
    presses: tuple[Press, ...]
    period_s: float = PERIOD_S
    final_rest_frames: int = 1
    first: int = 0

    @property
    def numbers(self) -> range:
        """The presses' numbers in the recording; the rest after them has the next one."""
        return range(self.first, self.first + len(self.presses))

    def press(self, number: int) -> Press:
        """The press of that number."""
        return self.presses[number - self.first]

    def frames_of(self, number: int) -> int:
        """Frames that bear that number."""
        return self.press(number).frames if number in self.numbers else self.final_rest_frames

    @property
    def frames(self) -> int:
        """Frames of the whole plan."""
        return sum(press.frames for press in self.presses) + self.final_rest_frames

    @property
    def contacts(self) -> int:
        """Contacts a frame has room for."""
        return max((len(press.contact_m) for press in self.presses), default=1)

    def duration_s(self, travel_s: float = 6.0) -> float:
        """About how long it takes; ``travel_s`` for going from press to press."""
        total = self.final_rest_frames * self.period_s
        for press in self.presses:
            depth = 0.0
            for step in press.steps:
                moved = abs((step.depth_m if step.depth_m is not None else depth) - depth)
                depth = step.depth_m if step.depth_m is not None else depth
                total += step.wait_s + max(self.period_s, moved / press.speed_m_s) * step.frames
            total += press.rest_s + press.rest_frames * self.period_s + travel_s
        return total

    def as_dict(self) -> dict[str, object]:
        """The plan in plain types, as ``plan_of`` reads it."""
        fields = asdict(self)
        # Recordings half done before plans had a first number are still gone on with.
        return fields if self.first else {name: value for name, value in fields.items() if name != "first"}


def ramp(
    depth_m: float = 4e-3,
    step_m: float = 1e-4,
    hold_frames: int = 4,
    hold_s: float = 0.0,
    unloading: bool = True,
) -> tuple[Step, ...]:
    """Loading from 0 to ``depth_m`` in equal steps, a hold, the same way back (paper III-A: 0 to 4 mm by 0.1 mm)."""
    if depth_m <= 0 or step_m <= 0:
        raise PlanError(f"a ramp needs depth and step above 0, not {depth_m:g} and {step_m:g} m")
    depths = np.linspace(0.0, depth_m, round(depth_m / step_m) + 1)
    steps = [Step(Phase.LOADING, float(depth)) for depth in depths]
    if hold_frames:
        steps.append(Step(Phase.HOLD, float(depth_m), hold_frames, hold_s))
    if unloading:
        steps += [Step(Phase.UNLOADING, float(depth)) for depth in depths[-2::-1]]
    return tuple(steps)


def taxel_plan(taxel_m: Array, name: str = "taxels", **options: float) -> Plan:
    """The paper's indentation experiment: every taxel in order. Options go to ``ramp``."""
    steps = ramp(**options)  # type: ignore[arg-type]
    return Plan(name, tuple(Press(((float(x), float(y)),), steps) for x, y in taxel_m))


def one_point_test(taxel_m: Array, depths: int = 8, first_m: float = 3.5e-4, step_m: float = 5e-4) -> Plan:
    """The paper's one-point test (IV-D): every taxel at eight other depths than the calibration's."""
    steps = tuple(Step(Phase.LOADING, first_m + step_m * k) for k in range(depths))
    return Plan("one_point_test", tuple(Press(((float(x), float(y)),), steps) for x, y in taxel_m))


def pairs_of(taxel_m: Array) -> list[tuple[int, int]]:
    """Pairs of the taxels (n,2), as many as the paper's at most: its own of 36; of others drawn, each taxel in one of
    them, and a third of the largest distance or more apart.

    Raises ``PlanError`` where there are fewer than two taxels.
    """
    if len(taxel_m) < 2:
        raise PlanError(f"two points need two taxels, the sensor has {len(taxel_m)}")
    if len(taxel_m) == 36:
        return list(PAIRS)
    apart_m = np.linalg.norm(taxel_m[:, None] - taxel_m, axis=-1)
    left: list[int] = np.random.default_rng(0).permutation(len(taxel_m)).tolist()
    pairs: list[tuple[int, int]] = []
    while left and len(pairs) < len(PAIRS):
        first = left.pop(0)
        other = next((k for k in left if apart_m[first, k] >= apart_m.max() / 3), None)
        if other is not None:
            left.remove(other)
            pairs.append((first, other))
    return pairs


def two_point_test(taxel_m: Array, pairs: Sequence[tuple[int, int]], weight_n: float = WEIGHT_N) -> Plan:
    """The paper's two-point test (IV-D): pairs of taxels under weights placed by hand; rest at its ends only.

    Raises ``PlanError`` for what isn't a pair of the taxels, and where there is none.
    """
    if not pairs:
        raise PlanError("no pairs: null chooses them, or give some as [[0, 35], [7, 28]]")
    presses = []
    for number, pair in enumerate(pairs):
        if not _is_pair(pair, len(taxel_m)):
            raise PlanError(f"pair {pair}: expected two different taxels of 0 to {len(taxel_m) - 1}")
        places = tuple((float(taxel_m[k, 0]), float(taxel_m[k, 1])) for k in pair)
        steps = (Step(Phase.HOLD, None, 1, 10.0),)
        presses.append(Press(places, steps, rest_frames=1 if number == 0 else 0, weight_n=weight_n))
    return Plan("two_point_test", tuple(presses))


def _is_pair(pair: Sequence[int], taxels: int) -> bool:
    whole = isinstance(pair, Sequence) and all(type(k) is int and 0 <= k < taxels for k in pair)
    return whole and len(pair) == len(set(pair)) == 2


def anywhere_test(
    extent_m: Array,
    presses: Sequence[int] = (24, 12, 8),
    depth_m: tuple[float, float] = (1e-3, 3.5e-3),
    weights_n: Sequence[float] = (0.980665, 1.96133, 4.903325),
    margin_m: float = 0.01,
    apart_m: float = 0.02,
    seed: int = 0,
) -> Plan:
    """Random places between the corners ``extent_m`` (2,2): single presses of the stage, several contacts by weights.

    ``presses``: how many presses of one contact, of two, and so on; contacts of one press lie ``apart_m`` or more from
    one another and bear one of ``weights_n`` each. Raises ``PlanError`` where so many have no room.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 8]))
    low, high = np.asarray(extent_m, dtype=float) + np.array([[margin_m], [-margin_m]])
    if not (low < high).all():
        raise PlanError(f"a margin of {1e3 * margin_m:g} mm leaves nothing of the sheet")
    planned = []
    for contacts, count in enumerate(presses, 1):
        for _ in range(count):
            places = _apart(rng, low, high, contacts, apart_m)
            if contacts == 1:
                planned.append(Press(places, (Step(Phase.LOADING, float(rng.uniform(*depth_m))),)))
            else:
                weight = float(rng.choice(weights_n))
                planned.append(Press(places, (Step(Phase.HOLD, None, 1, 10.0),), weight_n=weight))
    return Plan("anywhere_test", tuple(planned))


def _apart(
    rng: np.random.Generator, low: Array, high: Array, count: int, apart_m: float
) -> tuple[tuple[float, float], ...]:
    """So many random places, each ``apart_m`` or more from the others."""
    for _ in range(1000):
        place = rng.uniform(low, high, (count, 2))
        away = np.linalg.norm(place[:, None] - place, axis=2) + np.diag(np.full(count, np.inf))
        if away.min() >= apart_m:
            return tuple((float(x), float(y)) for x, y in place)
    raise PlanError(f"{count} contacts {1e3 * apart_m:g} mm apart have no room on this sheet")


def repeated(plan: Plan, times: int) -> Plan:
    """The plan's presses gone through so many times."""
    return replace(plan, presses=plan.presses * times)


def plan_from_presses(presses: object, name: str = "next_press", period_s: float = PERIOD_S) -> Plan:
    """A diagnosis's ``next_press``: the presses of its list ``press``; raises ``PlanError``.

    Each entry has ``position_m`` (x, y), ``depth_m``, ``hold_s``, ``speed_m_per_s`` and ``cycles``: so many times down
    at that speed, held, and up again, without leaving the place. A frame is taken every ``period_s`` of the way (every
    0.1 mm where that is longer) and of the hold, and three at rest before each press.
    """
    if not isinstance(presses, Sequence) or isinstance(presses, str) or not presses:
        raise PlanError("press: needs a list of presses")
    return Plan(name, tuple(_wanted(entry, f"press[{k}]", period_s) for k, entry in enumerate(presses)), period_s)


def _wanted(entry: object, where: str, period_s: float) -> Press:
    known = {"position_m", "depth_m", "hold_s", "speed_m_per_s", "cycles"}
    if not isinstance(entry, Mapping) or set(entry) != known:
        raise PlanError(f"{where}: needs {', '.join(sorted(known))} and nothing else")
    place = _position(entry["position_m"], f"{where}: position_m")
    depth, hold_s, speed, cycles = (
        _number(entry[name], f"{where}: {name}") for name in ("depth_m", "hold_s", "speed_m_per_s", "cycles")
    )
    if depth <= 0 or speed <= 0 or cycles < 1 or cycles != round(cycles):
        raise PlanError(f"{where}: depth_m and speed_m_per_s must be above 0, cycles a whole number of 1 or more")
    step = min(depth, max(speed * period_s, FINEST_STEP_M))
    cycle = ramp(depth, step, max(1, round(hold_s / period_s)))
    return Press((place,), cycle * round(cycles), rest_frames=3, speed_m_s=speed)


def plan_of(fields: Mapping[str, object]) -> Plan:
    """A plan from plain types, as a YAML file gives them or ``Plan.as_dict`` does; raises ``PlanError``.

    ``presses`` is a list of entries with ``contact_m`` (one place or several) and either ``steps`` (entries with
    ``phase``, ``depth_m``, ``frames``, ``wait_s``) or ``ramp`` (the arguments of ``ramp``).
    """
    entries = fields.get("presses")
    if not isinstance(entries, Sequence) or isinstance(entries, str) or not entries:
        raise PlanError("a plan needs a list of presses")
    presses = tuple(_press(entry, f"presses[{number}]") for number, entry in enumerate(entries))
    period_s = _number(fields.get("period_s", PERIOD_S), "period_s")
    if period_s <= 0:
        raise PlanError("period_s must be above 0")
    final = int(_number(fields.get("final_rest_frames", 1), "final_rest_frames"))
    first = int(_number(fields.get("first", 0), "first"))
    return Plan(str(fields.get("name", "plan")), presses, period_s, final, first)


def _press(entry: object, where: str) -> Press:
    if not isinstance(entry, Mapping):
        raise PlanError(f"{where}: needs contact_m and steps or ramp")
    known = {"contact_m", "steps", "ramp", "rest_frames", "rest_s", "speed_m_s", "weight_n"}
    if unknown := set(entry) - known:
        raise PlanError(f"{where}: does not know {sorted(unknown)}; choose from {sorted(known)}")
    places = entry.get("contact_m")
    if not isinstance(places, Sequence) or not places:
        raise PlanError(f"{where}: contact_m must be a place or a list of places")
    if not isinstance(places[0], Sequence):
        places = [places]
    contact = tuple(_position(place, f"{where}: contact_m") for place in places)
    if "ramp" in entry:
        options = entry["ramp"] or {}
        try:
            steps = ramp(**options)
        except TypeError as error:
            raise PlanError(f"{where}: ramp: {error}") from None
    else:
        steps = tuple(_step(step, f"{where}: steps[{k}]") for k, step in enumerate(entry.get("steps") or ()))
    if not steps:
        raise PlanError(f"{where}: has no steps")
    weight = entry.get("weight_n")
    press = Press(
        contact,
        steps,
        int(_number(entry.get("rest_frames", 1), f"{where}: rest_frames")),
        _number(entry.get("rest_s", 5.0), f"{where}: rest_s"),
        _number(entry.get("speed_m_s", 1e-3), f"{where}: speed_m_s"),
        None if weight is None else _number(weight, f"{where}: weight_n"),
    )
    if press.speed_m_s <= 0:
        raise PlanError(f"{where}: speed_m_s must be above 0")
    return press


def _step(entry: object, where: str) -> Step:
    if not isinstance(entry, Mapping) or "phase" not in entry:
        raise PlanError(f"{where}: needs phase and depth_m")
    phase = entry["phase"]
    try:
        known = Phase[phase.upper()] if isinstance(phase, str) else Phase(int(phase))
    except (KeyError, ValueError, TypeError):
        raise PlanError(f"{where}: phase {phase!r} is none of rest, loading, hold, unloading") from None
    depth = entry.get("depth_m")
    return Step(
        known,
        None if depth is None else _number(depth, f"{where}: depth_m"),
        int(_number(entry.get("frames", 1), f"{where}: frames")),
        _number(entry.get("wait_s", 0.0), f"{where}: wait_s"),
    )


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value < 0:
        raise PlanError(f"{where}: {value!r} is no number of 0 or more")
    return float(value)


def _position(value: object, where: str) -> tuple[float, float]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        raise PlanError(f"{where}: {value!r} is no place (x, y)")
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float) or not np.isfinite(number):
            raise PlanError(f"{where}: {number!r} is no number")
    return float(value[0]), float(value[1])

"""What the bench does to the skin: the plans of the paper's experiment and variations of it, as commanded histories."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.history import History, Phase
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

WEIGHT_N = 0.5 * 9.81
STEPS_M: Array = 5e-4 * np.arange(1.0, 9.0)
QUICK_TAXELS = (0, 4, 7, 9, 14, 16, 19, 21, 26, 28, 31, 35)
TWO_POINT_TAXELS = (
    *((0, 35), (7, 28), (2, 14), (5, 30), (8, 22), (13, 16), (1, 33), (19, 23)),
    *((10, 25), (4, 26), (12, 17), (20, 32), (6, 11), (3, 27)),
)


class _Clock:
    """Collects frames one after another."""

    def __init__(self, contacts: int, start_s: float) -> None:
        self.time_s, self.contacts = start_s, contacts
        self.rows: list[tuple[float, int, int, Array, Array]] = []

    def frame(
        self, wait_s: float, press: int, phase: Phase, contact_m: Array | None = None, depth_m: float = np.nan
    ) -> None:
        self.time_s += wait_s
        contact = np.full((self.contacts, 2), np.nan)
        depth = np.full(self.contacts, np.nan)
        if contact_m is not None:
            contact[: len(contact_m)] = contact_m
            depth[: len(contact_m)] = depth_m
        self.rows.append((self.time_s, press, int(phase), contact, depth))

    def history(self) -> History:
        time_s, press, phase, contact, depth = (list(column) for column in zip(*self.rows, strict=True))
        return History(
            np.array(time_s),
            np.array(press, dtype=np.int64),
            np.array(phase, dtype=np.uint8),
            np.array(contact),
            np.array(depth),
            np.full((len(time_s), self.contacts), np.nan),
        )


def presses(
    place_m: Array,
    depth_m: Array = STEPS_M,
    step_s: float | Array = 0.5,
    rest_s: float = 10.0,
    hold_s: float = 4.0,
    holds: int = 3,
    unloading: bool = True,
) -> History:
    """One press a place (n,2): a rest frame, the depths one by one, holds at the deepest, and back up.

    ``step_s`` is the time from step to step, one for all presses or one for each.
    """
    clock = _Clock(1, 0.0)
    pace = np.broadcast_to(np.asarray(step_s, dtype=float), len(place_m))
    for number, place in enumerate(place_m):
        clock.frame(rest_s, number, Phase.REST)
        for depth in depth_m:
            clock.frame(pace[number], number, Phase.LOADING, place[None], depth)
        for _ in range(holds):
            clock.frame(hold_s, number, Phase.HOLD, place[None], depth_m[-1])
        for depth in depth_m[-2::-1] if unloading else ():
            clock.frame(pace[number], number, Phase.UNLOADING, place[None], depth)
    clock.frame(rest_s, len(place_m), Phase.REST)
    return clock.history()


def weights(sensor: Sensor) -> History:
    """The paper's two-point test: 14 pairs of 500 g weights; the weights' force stands in ``force_n``."""
    clock = _Clock(2, 0.0)
    clock.frame(5.0, 0, Phase.REST)
    for number, pair in enumerate(TWO_POINT_TAXELS):
        clock.frame(20.0, number, Phase.HOLD, sensor.taxel_m[list(pair)])
    clock.frame(20.0, len(TWO_POINT_TAXELS), Phase.REST)
    history = clock.history()
    history.force_n[history.touched] = WEIGHT_N
    return history


def _half(sensor: Sensor) -> Array:
    """Every other taxel, like one colour of a chessboard."""
    columns = len(np.unique(sensor.taxel_m[:, 0].round(6)))
    number = np.arange(len(sensor.taxel_m))
    return sensor.taxel_m[(number % columns + number // columns) % 2 == 0]


PLANS: dict[str, Callable[[Sensor], History]] = {
    "indentation": lambda sensor: presses(sensor.taxel_m),
    "quick": lambda sensor: presses(sensor.taxel_m[list(QUICK_TAXELS)], STEPS_M[1::2], holds=1),
    "revisit": lambda sensor: presses(sensor.taxel_m[[*QUICK_TAXELS, QUICK_TAXELS[0]]], STEPS_M[1::2], holds=1),
    "half": lambda sensor: presses(_half(sensor)),
    "repeats": lambda sensor: presses(np.tile(_half(sensor), (2, 1)), holds=1),
    "two_speeds": lambda sensor: presses(_half(sensor), step_s=np.resize([0.5, 3.0], len(_half(sensor)))),
    "no_unloading": lambda sensor: presses(sensor.taxel_m, holds=1, unloading=False),
    "one_speed": lambda sensor: presses(sensor.taxel_m, holds=0),
    "test_one": lambda sensor: presses(sensor.taxel_m, STEPS_M - 1.5e-4, holds=0, unloading=False),
    "test_two": weights,
}
"""Plans by name. ``half`` and ``quick`` are small, ``revisit`` is ``quick`` with its first place pressed once more;
``no_unloading`` and ``one_speed`` hide what depends on history."""

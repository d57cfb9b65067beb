"""Which presses of a recording are kept: at random, on a grid, or chosen one after another for what they tell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ertskin.bench.press_choice import chosen_press
from ertskin.data.chosen_presses import made_presses, presses_of
from ertskin.data.informative_press import Accuracy
from ertskin.hardware.recording import Recording

Array = NDArray[np.float64]
GRIDS = {1: (1, 1), 2: (2, 1), 3: (3, 1), 6: (3, 2), 12: (4, 3)}
"""Presses along the sheet's longer side and across it."""
WANTED = Accuracy(force_n=0.1, location_m=0.5e-3)


def places_of(recording: Recording) -> tuple[list[int], Array]:
    """Numbers of the presses (n,) and their places (n,2) in metre."""
    assert recording.frames is not None
    history = recording.frames.history
    numbers = made_presses(recording.frames).tolist()
    return numbers, np.array([history.contact_m[(history.press == k) & (history.phase > 0)][0, 0] for k in numbers])


def random_order(recording: Recording, seed: int) -> list[int]:
    """All presses in an order drawn with ``seed``."""
    return [int(k) for k in np.random.default_rng(seed).permutation(places_of(recording)[0])]


def gridded(recording: Recording, count: int) -> list[int]:
    """The presses nearest to the middles of ``count`` equal cells."""
    numbers, place_m = places_of(recording)
    low, high = place_m.min(axis=0), place_m.max(axis=0)
    along, across = GRIDS[count]
    shape = (along, across) if high[0] - low[0] >= high[1] - low[1] else (across, along)
    x, y = (np.linspace(low[k], high[k], 2 * shape[k] + 1)[1::2] for k in range(2))
    wanted = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return [numbers[int(np.linalg.norm(place_m - place, axis=1).argmin())] for place in wanted]


def chosen_order(recording: Recording, count: int, say: Callable[[str], None]) -> tuple[list[int], list[Accuracy]]:
    """``count`` presses as ``ertskin record plan=next`` would ask for them, and the accuracy expected after each.

    The first lies in the middle; each further one is chosen knowing the presses before it alone.
    """
    assert recording.sensor is not None
    numbers, place_m = places_of(recording)
    order = [numbers[int(np.linalg.norm(place_m - recording.sensor.extent_m.mean(axis=0), axis=1).argmin())]]
    expected = []
    while True:
        choice = chosen_press(presses_of(recording, order), "chosen so far", place_m, WANTED)
        expected.append(choice.now)
        say(f"{len(order)} presses {order}: {choice.now.force_n:.3f} N, {1e3 * choice.now.location_m:.3f} mm expected")
        if len(order) == count:
            return order, expected
        order.append(numbers[int(np.linalg.norm(place_m - choice.place_m, axis=1).argmin())])

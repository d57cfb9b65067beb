"""The grids of sensing points an evaluation compares: each with its settings, its networks, the frames it can judge."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig, open_dict

from ertskin.data.grid import grid_m
from ertskin.data.touches import Touches
from ertskin.errors import UserError
from ertskin.evaluation.trained import Group, grouped, on_grid
from ertskin.models.reconstruction import Reconstruction
from ertskin.physics.sensor import Sensor

OWN = "recording"
"""Name of the grid of the recording's own taxels."""


@dataclass(frozen=True)
class Grid:
    """A grid's name, empty where it is the only one; the configuration with it; its networks by their names."""

    name: str
    config: DictConfig
    groups: dict[str, Group]


def grids(config: DictConfig, models: Sequence[Reconstruction], sensor: Sensor) -> list[Grid]:
    """``config.grids`` with the networks that answer on each, named after it; ``config.grid`` with all where null.

    Raises ``UserError`` for a name that is no grid's, and where a grid has no network.
    """
    if config.grids is None:
        return [Grid("", config, grouped(models))]
    return [_named(str(name), config, models, sensor) for name in config.grids]


def _named(name: str, config: DictConfig, models: Sequence[Reconstruction], sensor: Sensor) -> Grid:
    own = config.copy()
    with open_dict(own):
        own.grid = _size(name)
    taxel_m = grid_m(own.grid, sensor)
    fitting = list(on_grid(dict(enumerate(models)), taxel_m).values())
    if not fitting:
        raise UserError(
            f"grids: none of {len(models)} models answers for the {len(taxel_m)} points of {name}; "
            f"train one: ertskin train recording={config.recording} grid={name}"
        )
    return Grid(name, own, {f"{network} {name}": group for network, group in grouped(fitting).items()})


def _size(name: str) -> dict[str, int | None]:
    if name == OWN:
        return {"columns": None, "rows": None}
    if (size := re.fullmatch(r"(\d+)x(\d+)", name)) is None:
        raise UserError(f"grids: '{name}' is no grid; expected names as 6x6, or {OWN} for the recording's own taxels")
    return {"columns": int(size[1]), "rows": int(size[2])}


def on_points(touches: Touches, taxel_m: NDArray[np.float64], within_m: float) -> Touches:
    """The frames whose every contact lies within ``within_m`` of one of the points (n,2): those a grid can name."""
    away = np.linalg.norm(touches.history.contact_m[:, :, None] - taxel_m, axis=-1).min(axis=-1)
    return touches[np.flatnonzero(~(touches.history.touched & (away > within_m)).any(axis=1))]

"""Frames from arrays in whatever order they were kept: voltages put where the protocol reads them, presses counted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ertskin.hardware.measurement import Frames
from ertskin.importing.columns import times_s
from ertskin.importing.entry import Source
from ertskin.physics.history import History, Phase
from ertskin.physics.protocol import Protocol

Array = NDArray[np.float64]
FIELDS = ("voltage_v", "order", "time_s", "rest", "phase", "press", "contact_m", "depth_m", "force_n")


def frames_of(fields: dict[str, Any], protocol: Protocol, source: Source) -> Frames:
    """The frames of a mapping's fields; raises ``UserError`` where one is missing or doesn't fit the others."""
    if unknown := set(fields) - set(FIELDS):
        raise source.refuse("frames", f"unknown {', '.join(sorted(unknown))}; there are {', '.join(FIELDS)}")
    if "voltage_v" not in fields:
        raise source.refuse("frames.voltage_v", "missing")
    voltage = _voltages(np.asarray(fields["voltage_v"], dtype=float), fields.get("order", "fixed"), protocol, source)
    return Frames(voltage.astype(np.float32), _history(fields, len(voltage), source))


def _voltages(given: Array, order: str, protocol: Protocol, source: Source) -> Array:
    """(T,K,M) volt, NaN where nothing is read, of (T,K,M), (T,K*M) or as many readings a frame as are taken."""
    injections, readings = protocol.shape
    taken = int(protocol.taken.sum())
    if given.ndim == 3 and given.shape[1:] == protocol.shape:
        return np.where(protocol.taken, given, np.nan)
    if given.ndim == 3:
        given = given.reshape(len(given), -1)
    if given.ndim == 1:
        given = given[None]
    sizes = {taken, injections * readings}
    fits = [axis for axis in range(2) if given.shape[axis] in sizes]
    if not fits:
        raise source.refuse(
            "frames.voltage_v",
            f"found {' x '.join(map(str, given.shape))}, expected one axis of {taken} readings "
            f"({injections} injections, {readings} readings each, {taken} taken)",
        )
    if len(fits) == 2 and given.shape[0] != given.shape[1]:
        raise source.refuse("frames.voltage_v", f"either axis of {given.shape} may be the readings; say axes: [0, 1]")
    rows = given if 1 in fits else given.T
    if rows.shape[1] != taken:
        return np.where(protocol.taken, rows.reshape(-1, injections, readings), np.nan)
    voltage = np.full((len(rows), injections, readings), np.nan)
    where = _positions(order, protocol, source)
    voltage[:, where[:, 0], where[:, 1]] = rows
    return voltage


def _positions(order: str, protocol: Protocol, source: Source) -> NDArray[np.intp]:
    """(R,2) injection and column of the readings taken, in the order they were kept.

    ``fixed``: every injection's from column 0 on; ``rotating``: injection k's from column k on, and around.
    """
    injections, readings = protocol.shape
    if order not in ("fixed", "rotating"):
        raise source.refuse("frames.order", f"found {order!r}, expected fixed or rotating")
    shift = np.arange(injections) if order == "rotating" else np.zeros(injections, dtype=int)
    column = (np.arange(readings) + shift[:, None]) % readings
    where = np.stack([np.broadcast_to(np.arange(injections)[:, None], column.shape), column], axis=-1).reshape(-1, 2)
    return where[protocol.taken[where[:, 0], where[:, 1]]]


def _history(fields: dict[str, Any], frames: int, source: Source) -> History:
    contact = _per_contact(fields, "contact_m", frames, source, width=2)
    depth, force = (_per_contact(fields, name, frames, source) for name in ("depth_m", "force_n"))
    contacts = max(0 if array is None else array.shape[1] for array in (contact, depth, force))
    contact = np.full((frames, contacts, 2), np.nan) if contact is None else contact
    depth, force = (np.full((frames, contacts), np.nan) if array is None else array for array in (depth, force))
    phase = _phase(fields, contact, frames, source)
    press = fields.get("press")
    time = times_s(fields, frames, "frames", source)
    counted = _press(phase, contact) if press is None else np.asarray(press).ravel()
    for name, column in (("time_s", time), ("phase", phase), ("press", counted)):
        if len(column) != frames:
            raise source.refuse(f"frames.{name}", f"found {len(column)} values, expected {frames}, one a frame")
    return History(time, counted.astype(np.int64), phase, contact, depth, force)


def _per_contact(fields: dict[str, Any], name: str, frames: int, source: Source, width: int = 1) -> Array | None:
    """(T,P) or (T,P,2) of a field given for every frame."""
    if name not in fields:
        return None
    given = np.asarray(fields[name], dtype=float)
    if given.shape[0] != frames or given.size % (frames * width):
        raise source.refuse(f"frames.{name}", f"found shape {given.shape}, expected {frames} rows, one a frame")
    return given.reshape(frames, -1, 2) if width == 2 else given.reshape(frames, -1)


def _phase(fields: dict[str, Any], contact_m: Array, frames: int, source: Source) -> NDArray[np.uint8]:
    """(T,) phases: given, or rest and hold by ``rest``: so many frames at the start, or a flag for each frame.

    With neither, the frames without a contact are at rest.
    """
    if "phase" in fields:
        return np.asarray(fields["phase"]).ravel().astype(np.uint8)
    rest = fields.get("rest")
    if rest is None:
        if not contact_m.shape[1]:
            raise source.refuse(
                "frames.rest", "missing: how many frames at the start nothing touches, or a flag a frame"
            )
        flags = np.isnan(contact_m).all(axis=(1, 2))
    elif np.ndim(rest) == 0:
        flags = np.arange(frames) < int(rest)
    else:
        flags = np.asarray(rest).ravel() != 0
    return np.where(flags, Phase.REST, Phase.HOLD).astype(np.uint8)


def _press(phase: NDArray[np.uint8], contact_m: Array) -> NDArray[np.int64]:
    """(T,) press numbers: another one begins at rest after a press, and where the contacts move to other places."""
    rest = phase == Phase.REST
    place = np.nan_to_num(contact_m.reshape(len(phase), -1), nan=np.inf)
    begins = rest[1:] & ~rest[:-1]
    moves = ~rest[1:] & ~rest[:-1] & (place[1:] != place[:-1]).any(axis=1)
    return np.concatenate([[0], np.cumsum(begins | moves)]).astype(np.int64)

"""Frames into a recording file as they come, so that nothing once acknowledged is lost.

While it runs the recording lies beside its place, under its name with ``.part`` behind, in HDF5's single-writer mode:
whatever happens to the process, what was flushed can be read. At the end it is written anew as a plain recording and
put in its place. A frame is acknowledged when ``append`` returns; at the end of every press the file is also forced to
disk.
"""

from __future__ import annotations

import fcntl
import json
import os
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from hardware.plan import Plan
from hardware.recording import (
    UNFINISHED,
    Frames,
    Recording,
    RecordingError,
    read_recording,
    write_parts,
    write_recording,
)
from physics.history import Phase

Array = NDArray[np.float64]
ROWS = 64
"""Frames a chunk of the small columns holds."""
NOTE = np.dtype([("time_s", "<f8"), ("text", "S200")])


@dataclass(frozen=True, eq=False)
class FrameEntry:
    """One frame as it is appended. ``contact_m`` (P,2), ``depth_m`` and ``force_n`` (P,), NaN where not known."""

    voltage_v: NDArray[np.float32]
    count: NDArray[np.int32] | None
    time_s: float
    press: int
    phase: Phase
    contact_m: Array
    depth_m: Array
    force_n: Array


def part_of(path: Path) -> Path:
    """Where a recording lies while it is being made."""
    return path.with_name(path.name + ".part")


class Recorder:
    """Appends frames and notes to a recording under way."""

    def __init__(self, path: Path, header: Recording, plan: Plan, shape: tuple[int, int], counts: bool) -> None:
        """Begin a recording of ``plan`` at ``path``; ``header`` holds all but the frames, ``shape`` is (K,M).

        Raises ``RecordingError`` where a recording, finished or half done, is there already.
        """
        for taken in (path, part_of(path)):
            if taken.exists():
                raise RecordingError(f"{taken}: found a file already there, expected a free name")
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.frames = 0
        self._file = _begun(part_of(path), header, plan, shape, counts)
        self._lock = _locked(part_of(path))
        self._group = self._file["frames"]
        self._notes = self._file["log/note"]

    @classmethod
    def resumed(cls, path: Path, plan: Plan) -> tuple[Recorder, Recording]:
        """Go on with the half-done recording of ``path``; also what it holds so far.

        Raises ``RecordingError`` where there is none, or where it was made for another plan.
        """
        part = part_of(path)
        so_far = read_recording(part)
        os.close(_locked(part))
        with h5py.File(part, "r", swmr=True, libver="latest", locking=False) as file:
            stored = json.loads(str(file["frames"].attrs.get("plan", "{}")))
            notes = file["log/note"][()] if "log/note" in file else np.zeros(0, NOTE)
        if stored != json.loads(json.dumps(plan.as_dict())):
            raise RecordingError(f"{part}: found another plan half done, expected the same plan to go on with")
        frames = so_far.frames
        assert frames is not None
        self = cls.__new__(cls)
        self.path = path
        self.frames = 0
        fresh = part.with_name(part.name + ".new")
        fresh.unlink(missing_ok=True)
        shape = (frames.voltage_v.shape[1], frames.voltage_v.shape[2])
        self._file = _begun(fresh, replace(so_far, frames=None), plan, shape, frames.adc_count is not None)
        self._lock = _locked(fresh)
        self._group = self._file["frames"]
        self._notes = self._file["log/note"]
        for number in range(len(frames)):
            self.append(_entry(frames, number))
        for time_s, text in notes:
            self.note(float(time_s), text.decode("ascii", "replace"))
        self.sync()
        os.replace(fresh, part)
        return self, so_far

    def append(self, entry: FrameEntry) -> None:
        """Add a frame; when this returns, it is kept."""
        columns: dict[str, object] = {
            "voltage_v": entry.voltage_v,
            "press": entry.press,
            "phase": int(entry.phase),
            "contact_m": entry.contact_m,
            "depth_m": entry.depth_m,
            "force_n": entry.force_n,
        }
        if "adc_count" in self._group:
            columns["adc_count"] = entry.count
        # Time comes last, so that no column is behind the one that tells how many frames there are.
        columns["time_s"] = entry.time_s
        for name, value in columns.items():
            column = self._group[name]
            column.resize(self.frames + 1, axis=0)
            column[self.frames] = value
        self._file.flush()
        self.frames += 1

    def note(self, time_s: float, text: str) -> None:
        """Keep a remark: a fault, a lost scan, a press given up."""
        self._notes.resize(len(self._notes) + 1, axis=0)
        self._notes[-1] = (time_s, text.encode("ascii", "replace")[:200])
        self._file.flush()

    def sync(self) -> None:
        """Force what is written to disk."""
        self._file.flush()
        os.fsync(self._file.id.get_vfd_handle())

    def finish(self) -> Recording:
        """Put the recording in its place, and return it."""
        notes = self._notes[()]
        self.close()
        part = part_of(self.path)
        recording = read_recording(part)
        write_recording(self.path, recording)
        if len(notes):
            self.path.with_name(self.path.name + ".log").write_text(
                "".join(f"{time_s:.3f} s  {text.decode('ascii', 'replace')}\n" for time_s, text in notes)
            )
        part.unlink()
        return recording

    def close(self) -> None:
        """Leave the recording half done, to be gone on with."""
        if self._file:
            self.sync()
            self._file.close()
            os.close(self._lock)


def _locked(path: Path) -> int:
    """A descriptor that keeps other recorders off ``path``; raises ``RecordingError`` where one is at it."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise RecordingError(f"{path}: found another process recording there, expected to be alone") from None
    return descriptor


def next_press(frames: Frames | None) -> int:
    """The number of the first press not begun."""
    if frames is None or len(frames) == 0:
        return 0
    begun = frames.history.press[frames.history.phase != Phase.REST]
    return int(begun.max()) + 1 if len(begun) else 0


def _begun(path: Path, header: Recording, plan: Plan, shape: tuple[int, int], counts: bool) -> h5py.File:
    file = h5py.File(path, "w", libver="latest", locking=False)
    write_parts(file, header, path)
    group = file.create_group("frames")
    group.attrs[UNFINISHED] = True
    group.attrs["plan"] = json.dumps(plan.as_dict())
    injections, readings = shape
    packed = {"chunks": (1, injections, readings), "compression": "gzip", "compression_opts": 1, "shuffle": True}
    group.create_dataset("voltage_v", (0, *shape), "<f4", maxshape=(None, *shape), **packed)
    if counts:
        group.create_dataset("adc_count", (0, *shape), "<i4", maxshape=(None, *shape), **packed)
    contacts = plan.contacts
    for name, dtype, tail in (
        ("time_s", "<f8", ()),
        ("press", "<i8", ()),
        ("phase", "u1", ()),
        ("contact_m", "<f8", (contacts, 2)),
        ("depth_m", "<f8", (contacts,)),
        ("force_n", "<f8", (contacts,)),
    ):
        group.create_dataset(name, (0, *tail), dtype, maxshape=(None, *tail), chunks=(ROWS, *tail))
    file.create_group("log").create_dataset("note", (0,), NOTE, maxshape=(None,), chunks=(16,))
    file.swmr_mode = True
    file.flush()
    return file


def _entry(frames: Frames, number: int) -> FrameEntry:
    history = frames.history
    return FrameEntry(
        frames.voltage_v[number],
        None if frames.adc_count is None else frames.adc_count[number],
        float(history.time_s[number]),
        int(history.press[number]),
        Phase(int(history.phase[number])),
        history.contact_m[number],
        history.depth_m[number],
        history.force_n[number],
    )

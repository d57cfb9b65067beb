"""Frames into a recording file as they come, so that nothing once acknowledged is lost.

While it runs the recording lies beside its place, under its name with ``.part`` behind, in HDF5's single-writer mode:
whatever happens to the process, what was flushed can be read. At the end it is written anew as a plain recording and
put in its place. A frame is acknowledged when ``append`` returns; at the end of every press the file is also forced to
disk. A press that was cut off is set apart, in a recording of its own, when the plan is gone on with.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import h5py
import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from ertskin.hardware.fields import first_line
from ertskin.hardware.plan import Plan, plan_of
from ertskin.hardware.recording import (
    UNFINISHED,
    Frames,
    Recording,
    RecordingError,
    read_recording,
    write_parts,
    write_recording,
)
from ertskin.physics.history import Phase

Array = NDArray[np.float64]
ROWS = 64
"""Frames a chunk of the small columns holds."""
BEFORE = "frames_before"
"""Attribute of /frames while a recorder is still appending: frames of the recording that presses are added to."""
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


def _fresh(path: Path) -> Path:
    """Where a recording lies while it takes over what was recorded before."""
    return path.with_name(path.name + ".part.new")


def cut_off_of(path: Path, press: int, attempt: int = 1) -> Path:
    """Where the frames of a press lie that was cut off, the first time or a later one."""
    return path.with_name(f"{path.stem}.press_{press}_cut_off_{attempt}{path.suffix}")


class Recorder:
    """Appends frames and notes to a recording under way."""

    set_apart: Path | None = None
    """Of one gone on with: where the frames of the press are that was cut off."""
    before = 0
    """Frames of the finished recording that presses are added to, which it replaces in the end."""

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
        self._lock = _locked(path)
        self._taken = None if header.protocol is None else header.protocol.taken
        self._open(_begun(part_of(path), header, plan, shape, counts))

    @classmethod
    def resumed(cls, path: Path, plan: Plan) -> tuple[Recorder, Recording]:
        """Go on with the half-done recording of ``path``; also what it holds so far: whole presses alone.

        The press that was cut off is set apart (``cut_off_of``) and to be repeated. Raises ``RecordingError`` where
        there is no such recording, or where it was made for another plan.
        """
        lock = _locked(path)
        try:
            return cls._resumed(path, plan, lock)
        except BaseException:
            _unlocked(lock)
            raise

    @classmethod
    def _resumed(cls, path: Path, plan: Plan, lock: FileLock) -> tuple[Recorder, Recording]:
        part = part_of(path)
        so_far = read_recording(part, sound=False)
        with h5py.File(part, "r", swmr=True, libver="latest", locking=False) as file:
            stored = json.loads(str(file["frames"].attrs.get("plan", "{}")))
            before = int(file["frames"].attrs.get(BEFORE, 0))
            notes = file["log/note"][()] if "log/note" in file else np.zeros(0, NOTE)
        if stored != json.loads(json.dumps(plan.as_dict())):
            raise RecordingError(f"{part}: found another plan half done, expected the same plan to go on with")
        assert so_far.frames is not None
        if before and path.exists() and not _alike(so_far.frames, read_recording(path, sound=False).frames, before):
            raise RecordingError(f"{part}: found presses added to another recording, expected to those of {path.name}")
        over = np.append(np.ones(before, dtype=bool), _over(so_far.frames[before:], plan))
        frames, half = so_far.frames[over], so_far.frames[~over]
        self = cls._refilled(path, replace(so_far, frames=frames), plan, lock, before)
        for time_s, text in notes:
            self.note(float(time_s), text.decode("ascii", "replace"))
        if len(half):
            self.set_apart = self._set_apart(so_far, half)
        self._put_in_place()
        return self, replace(so_far, frames=frames)

    @classmethod
    def adding_to(cls, path: Path, recording: Recording, plan: Plan) -> Recorder:
        """Add the presses of ``plan`` to the finished ``recording`` of ``path``, which ``finish`` replaces.

        Raises ``RecordingError`` where a half-done recording is there already, or this one has no frames or frames of
        another number of contacts.
        """
        if recording.frames is None:
            raise RecordingError(f"{path}: found no frames, expected a recording to add presses to")
        if part_of(path).exists():
            raise RecordingError(f"{part_of(path)}: found a half-done recording already there")
        contacts = recording.frames.history.contact_m.shape[1]
        if contacts != plan.contacts:
            raise RecordingError(f"{path}: found frames of {contacts} contacts, expected {plan.contacts} as planned")
        lock = _locked(path)
        try:
            self = cls._refilled(path, recording, plan, lock, len(recording.frames))
            self._put_in_place()
        except BaseException:
            _unlocked(lock)
            raise
        return self

    @classmethod
    def _refilled(cls, path: Path, recording: Recording, plan: Plan, lock: FileLock, before: int) -> Recorder:
        """A recorder that writes aside, and has the frames of ``recording`` already."""
        frames = recording.frames
        assert frames is not None
        self = cls.__new__(cls)
        self.path = path
        self.frames = 0
        self.before = before
        fresh = _fresh(path)
        fresh.unlink(missing_ok=True)
        shape = (frames.voltage_v.shape[1], frames.voltage_v.shape[2])
        self._lock = lock
        self._taken = None if recording.protocol is None else recording.protocol.taken
        header, counts = replace(recording, frames=None), frames.adc_count is not None
        self._open(_begun(fresh, header, plan, shape, counts, before))
        for number in range(len(frames)):
            self.append(_entry(frames, number))
        return self

    def _put_in_place(self) -> None:
        self.sync()
        # A file that is open can't be renamed everywhere.
        self._file.close()
        part = part_of(self.path)
        os.replace(_fresh(self.path), part)
        self._open(h5py.File(part, "r+", libver="latest", locking=False))
        self._file.swmr_mode = True

    def _open(self, file: h5py.File) -> None:
        self._file = file
        self._group = file["frames"]
        self._notes = file["log/note"]

    def _set_apart(self, so_far: Recording, half: Frames) -> Path:
        """Write the frames of a press that was cut off into a recording of their own, and note where they are."""
        press, begin_s = int(half.history.press[0]), float(half.history.time_s[0])
        places = (cut_off_of(self.path, press, attempt) for attempt in count(1))
        # There already if the last attempt to go on was killed before it did.
        aside = next(place for place in places if not place.exists() or _holds(place, half))
        said = f"press {press} was cut off after {len(half)} frames and is repeated"
        comment = f"{said} in {self.path.name}. {so_far.comment}".strip()
        write_recording(aside, replace(so_far, comment=comment, frames=half), overwrite=True)
        self.note(begin_s, f"{said}: {aside.name}")
        return aside

    def append(self, entry: FrameEntry) -> None:
        """Add a frame; when this returns, it is kept. Readings that the protocol doesn't take become NaN."""
        columns: dict[str, object] = {
            "voltage_v": entry.voltage_v if self._taken is None else np.where(self._taken, entry.voltage_v, np.nan),
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
        try:
            for name, value in columns.items():
                column = self._group[name]
                column.resize(self.frames + 1, axis=0)
                column[self.frames] = value
            self._file.flush()
        except BaseException:
            # A signal may come between a column's growth and its value: half a frame is none.
            for name in reversed(columns):
                self._group[name].resize(self.frames, axis=0)
            raise
        self.frames += 1

    def note(self, time_s: float, text: str) -> None:
        """Keep a remark: a fault, a lost scan, a press given up."""
        self._notes.resize(len(self._notes) + 1, axis=0)
        self._notes[-1] = (time_s, text.encode("ascii", "replace")[:200])
        self._file.flush()

    def sync(self) -> None:
        """Force what is written to disk."""
        self._file.flush()
        with open(self._file.filename, "rb+") as raw:
            os.fsync(raw.fileno())

    def finish(self) -> Recording:
        """Put the recording in its place, and return it."""
        notes = self._notes[()]
        self.close()
        part = part_of(self.path)
        recording = read_recording(part, sound=False)
        write_recording(self.path, recording, overwrite=self.before > 0)
        if len(notes):
            with self.path.with_name(self.path.name + ".log").open("a" if self.before else "w") as log:
                log.writelines(f"{time_s:.3f} s  {text.decode('ascii', 'replace')}\n" for time_s, text in notes)
        part.unlink()
        return recording

    def close(self) -> None:
        """Leave the recording half done, to be gone on with."""
        if self._file:
            self.sync()
            self._file.close()
            _unlocked(self._lock)


def _locked(path: Path) -> FileLock:
    """Keeps other recorders off ``path``; raises ``RecordingError`` where one is at it."""
    lock = FileLock(path.with_name(path.name + ".lock"))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise RecordingError(f"{path}: found another process recording there, expected to be alone") from None
    return lock


def _unlocked(lock: FileLock) -> None:
    # Where the system lets an open file be removed, nobody can take it in between.
    with suppress(OSError):
        os.unlink(lock.lock_file)
    lock.release()


def next_press(frames: Frames | None) -> int:
    """The number of the first press to make, given the frames of those that were made."""
    return 0 if frames is None or len(frames) == 0 else int(frames.history.press.max()) + 1


def half_done_plan(path: Path) -> Plan:
    """The plan of the half-done recording of ``path``; raises ``RecordingError`` where it doesn't say."""
    try:
        with h5py.File(part_of(path), "r", swmr=True, libver="latest", locking=False) as file:
            return plan_of(json.loads(str(file["frames"].attrs["plan"])))
    except (OSError, KeyError, ValueError) as error:
        raise RecordingError(f"{part_of(path)}: found no plan to go on with ({first_line(error)})") from None


def _alike(frames: Frames, others: Frames | None, count: int) -> bool:
    """Whether the first so many frames are the same."""
    return others is not None and np.array_equal(frames.voltage_v[:count], others.voltage_v[:count], equal_nan=True)


def _holds(path: Path, frames: Frames) -> bool:
    try:
        found = read_recording(path, sound=False).frames
    except RecordingError:
        return False
    return found is not None and np.array_equal(found.voltage_v, frames.voltage_v, equal_nan=True)


def _over(frames: Frames, plan: Plan) -> NDArray[np.bool_]:
    """(T,) which frames are those of presses that are over: all but those of the last one if it was cut off.

    A press given up in which an instrument failed is over once another one has begun.
    """
    press = frames.history.press
    if len(press) == 0:
        return np.zeros(0, dtype=bool)
    last = press == press.max()
    return np.asarray(~last | (np.count_nonzero(last) >= plan.frames_of(int(press.max()))))


def _begun(
    path: Path, header: Recording, plan: Plan, shape: tuple[int, int], counts: bool, before: int = 0
) -> h5py.File:
    file = h5py.File(path, "w", libver="latest", locking=False)
    write_parts(file, header, path)
    group = file.create_group("frames")
    group.attrs[UNFINISHED] = True
    group.attrs["plan"] = json.dumps(plan.as_dict())
    group.attrs[BEFORE] = before
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

"""A clean copy, in memory, of the groups a recording file may hold: what only the HDF5 library has to get through.

Run on a file as a program it writes the copy to standard output. It imports nothing of this package, so that starting
it costs no more than starting h5py.
"""

from __future__ import annotations

import math
import os
import signal
import sys

import h5py
import numpy as np

GROUPS = ("sensor", "protocol", "frames", "specimen", "rigid_block", "coupon", "truth")
MOST_BYTES = 512 * 2**20
"""A recording's data, unpacked."""
PACKED_AT_MOST = 1100
"""No filter of HDF5 packs tighter than about a thousand to one: a damaged header can claim any shape."""
UNREADABLE = "unreadable "
"""Prefix of the attribute that stands for a field that was there and could not be copied; its value says why."""
CANNOT_OPEN = 3
CANNOT_READ = 4
"""Exit statuses of the program."""


class CannotOpen(Exception):
    """HDF5 takes the file for none of its own; the message is the library's."""


class CannotRead(Exception):
    """The file's groups can't be listed; the message is the library's."""


def clean_copy(path: str) -> bytes:
    """The image of a fresh HDF5 file with the root's attributes and the known groups, one level deep.

    A field that can't be read leaves a zero and a mark (``UNREADABLE``): only who asks for it is refused. Raises
    ``CannotOpen`` or ``CannotRead``.
    """
    with _opened(path) as file:
        try:
            return _copied(file)
        except (OSError, RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
            raise CannotRead(_line(error)) from None


def _copied(file: h5py.File) -> bytes:
    with h5py.File.in_memory() as copy:
        _copy_attributes(file, copy)
        budget = MOST_BYTES
        for name in GROUPS:
            if name not in file:
                continue
            item = file[name]
            if isinstance(item, h5py.Group):
                group = copy.create_group(name)
                _copy_attributes(item, group)
                for field in item:
                    budget -= _copy_field(item, field, group, budget)
            else:
                copy[name] = 0
        copy.flush()
        return bytes(copy.id.get_file_image())


def _opened(path: str) -> h5py.File:
    """The file; one whose writer has not closed it HDF5 opens only as one being written."""
    try:
        return h5py.File(path, "r", locking=False)
    except (OSError, RuntimeError, ValueError) as error:
        try:
            return h5py.File(path, "r", swmr=True, libver="latest", locking=False)
        except (OSError, RuntimeError, ValueError):
            raise CannotOpen(_line(error)) from None


def _copy_attributes(source: h5py.Group, target: h5py.Group) -> None:
    for name in source.attrs:
        try:
            target.attrs[name] = source.attrs[name]
        except (OSError, RuntimeError, ValueError, TypeError, MemoryError) as error:
            target.attrs[name] = 0
            target.attrs[UNREADABLE + name] = _line(error)


def _copy_field(source: h5py.Group, name: str, target: h5py.Group, budget: int) -> int:
    """Copy a dataset of at most ``budget`` bytes and return how many it took; a group is copied as an empty one."""
    try:
        item = source[name]
        if not isinstance(item, h5py.Dataset):
            target.create_group(name)
            return 0
        reason = _too_large(item, budget)
        if reason is None:
            target.create_dataset(name, data=item[()], dtype=item.dtype)
            return int(item.nbytes)
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
        reason = f"unreadable data ({_line(error)})"
    if name not in target:
        target[name] = 0
    target.attrs[UNREADABLE + name] = reason
    return 0


def _too_large(item: h5py.Dataset, budget: int) -> str | None:
    """What speaks against reading a dataset whole, or None."""
    stored = PACKED_AT_MOST * max(item.id.get_storage_size(), 4096)
    size = math.prod(item.shape or (0,)) * item.dtype.itemsize
    if size > stored:
        return f"a claim of {size} bytes where at most {stored} can be stored"
    if size > budget:
        return f"{size} bytes, more than the {MOST_BYTES // 2**20} MiB a recording may unpack to"
    return None


def _line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _limit_processor_time(path: str) -> None:
    """Let the system end this process once it has worked far longer than a sound file of that size takes."""
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, processor_s(os.path.getsize(path)))


def processor_s(size: int) -> float:
    """Processor time allowed for a file of ``size`` bytes: ten times what a sound one was measured to take."""
    return 1.0 + size / 10e6


def main(path: str) -> int:
    """Write the copy to standard output; else one line to standard error, and how far it came as the exit status."""
    _limit_processor_time(path)
    try:
        image = clean_copy(path)
    except (CannotOpen, CannotRead) as error:
        print(error, file=sys.stderr)
        return CANNOT_OPEN if isinstance(error, CannotOpen) else CANNOT_READ
    sys.stdout.buffer.write(image)
    sys.stdout.flush()
    return 0


if __name__ == "__main__":
    np.seterr(all="ignore")
    sys.exit(main(sys.argv[1]))

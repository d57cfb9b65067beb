"""A second process that takes the indenter off the skin when the recording one is killed where it stands.

It holds one end of a pipe. A recording that ends by itself says so; a pipe that breaks without a word means that the
other process is gone, and with it whoever could raise the stage.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from hardware.clock import SystemClock
from hardware.failure import InstrumentError
from hardware.indenter import StillPressing
from hardware.rig import BAUD, STAGES
from hardware.transport import SerialTransport

ATTEMPTS = 60
PAUSE_S = 2.0
LEAVE_S = 60.0
"""Seconds the second process has to end when all is well; on a busy machine it may hardly have begun."""
WELL = b"well\n"


@contextmanager
def guarded(stage: Mapping[str, Any], height_m: float, speed_m_s: float) -> Iterator[None]:
    """Guard a stage, described as in a rig, while the block runs; a block that ends, however, ends it.

    An exception ends it too, for whoever raises it has raised the stage; not so ``StillPressing``: the guard goes on
    trying where the recording gave up.
    """
    words = json.dumps({"stage": dict(stage), "height_m": height_m, "speed_m_s": speed_m_s})
    process = subprocess.Popen(
        [sys.executable, "-m", "hardware.guardian", words], stdin=subprocess.PIPE, start_new_session=True
    )
    assert process.stdin is not None
    well = True
    try:
        yield
    except StillPressing:
        well = False
        raise
    finally:
        try:
            process.stdin.write(WELL if well else b"")
            process.stdin.close()
        except OSError:
            # It is gone itself; there was nothing for it to do.
            well = True
        if well:
            process.wait(LEAVE_S)


def stand_guard(words: str) -> int:
    """Wait for the word that all is well, or for the silence that is not; then raise the stage. Exit status."""
    if sys.stdin.buffer.read().endswith(WELL):
        return 0
    fields = json.loads(words)
    stage = fields["stage"]
    print("ertskin: the recording is gone, raising the stage", file=sys.stderr, flush=True)
    clock = SystemClock()
    for _ in range(ATTEMPTS):
        try:
            line = SerialTransport(stage["port"], int(stage.get("baud") or BAUD[stage["driver"]]), clock)
            driver = STAGES[stage["driver"]](line, stage)
            driver.recover()
            driver.raise_by(fields["height_m"], fields["speed_m_s"])
            driver.close()
        except InstrumentError as error:
            print(f"ertskin: {error}", file=sys.stderr, flush=True)
            clock.sleep(PAUSE_S)
        else:
            print("ertskin: the stage is up", file=sys.stderr, flush=True)
            return 0
    print("ertskin: the stage may still press, raise it by hand", file=sys.stderr, flush=True)
    return 1


if __name__ == "__main__":
    sys.exit(stand_guard(sys.argv[1]))

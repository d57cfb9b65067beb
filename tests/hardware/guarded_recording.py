"""Records on a bench in another process, guarded, until it is ended: ``FILE RIG_AS_JSON SECONDS_TO_RETRACT_IN WAY``.

At its first frame deep in the skin it hangs in a WAY, if one is given; another thread goes on looking at the clock.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ertskin.hardware import indenter
from ertskin.hardware.clock import Clock
from ertskin.hardware.experiment import Experiment, Progress
from ertskin.hardware.guardian import guarded
from ertskin.hardware.plan import Plan, Press, ramp
from ertskin.hardware.recorder import Recorder
from ertskin.hardware.recording import Recording
from ertskin.hardware.rig import open_rig
from ertskin.hardware.virtual.skin import SpringSkin
from ertskin.interrupts import unwind_on_sigterm

PRESSED_M = 6e-4


def stop() -> None:
    """As by Ctrl-Z or SIGSTOP, until it is set going."""
    os.kill(os.getpid(), signal.SIGSTOP)


def deadlock() -> None:
    """Wait for what never comes, and heed no request to end."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Event().wait()


WAYS = {"stop": [stop], "deadlock": [deadlock], "": []}


def hang(ways: list[Callable[[], None]], progress: Progress) -> None:
    """In the way asked for, once."""
    if ways and progress.depth_m > PRESSED_M:
        ways.pop()()


def look(clock: Clock) -> None:
    """Look at the clock for ever."""
    while True:
        clock.now()
        time.sleep(0.1)


if __name__ == "__main__":
    unwind_on_sigterm()
    indenter.RETRACT_S = float(sys.argv[3])
    skin, fields = SpringSkin(1), json.loads(sys.argv[2])
    rig = open_rig(fields, skin.sensor, skin.protocol)
    threading.Thread(target=look, args=(rig.clock,), daemon=True).start()
    press = Press(((0.03, 0.03),), ramp(1e-3, 2.5e-4, 2, unloading=False), rest_s=0.2, speed_m_s=5e-3)
    plan = Plan("guarded", (press,) * 20, period_s=0.1)
    header = Recording("guarded", "", "", skin.sensor, skin.protocol)
    recorder = Recorder(Path(sys.argv[1]), header, plan, skin.protocol.shape, counts=True)
    with guarded(rig, fields["stage"]):
        experiment = Experiment(rig, recorder, 0.0, partial(hang, WAYS[sys.argv[4]]))
        experiment.run(plan, surface_z_m=fields["geometry"]["origin_m"][2] - 7.3e-4)

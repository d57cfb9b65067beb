"""Records on a bench in another process, guarded, until it is ended: ``FILE RIG_AS_JSON SECONDS_TO_RETRACT_IN``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from ertskin.hardware import indenter
from ertskin.hardware.experiment import Experiment
from ertskin.hardware.guardian import guarded
from ertskin.hardware.plan import Plan, Press, ramp
from ertskin.hardware.recorder import Recorder
from ertskin.hardware.recording import Recording
from ertskin.hardware.rig import open_rig
from ertskin.hardware.virtual.skin import SpringSkin
from ertskin.interrupts import unwind_on_sigterm

if __name__ == "__main__":
    unwind_on_sigterm()
    indenter.RETRACT_S = float(sys.argv[3])
    skin, fields = SpringSkin(1), json.loads(sys.argv[2])
    rig = open_rig(fields, skin.sensor, skin.protocol)
    press = Press(((0.03, 0.03),), ramp(1e-3, 2.5e-4, 2, unloading=False), rest_s=0.2, speed_m_s=5e-3)
    plan = Plan("guarded", (press,) * 20, period_s=0.1)
    header = Recording("guarded", "", "", skin.sensor, skin.protocol)
    recorder = Recorder(Path(sys.argv[1]), header, plan, skin.protocol.shape, counts=True)
    with guarded(rig, fields["stage"]):
        experiment = Experiment(rig, recorder, 0.0)
        experiment.run(plan, surface_z_m=fields["geometry"]["origin_m"][2] - 7.3e-4)

"""Records on a bench in another process, guarded, until killed: ``FILE RIG_AS_JSON``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from small_experiment import plan_of_presses

from hardware.experiment import Experiment
from hardware.guardian import guarded
from hardware.recorder import Recorder
from hardware.recording import Recording
from hardware.rig import open_rig
from hardware.virtual.skin import SpringSkin

if __name__ == "__main__":
    skin, fields = SpringSkin(1), json.loads(sys.argv[2])
    rig = open_rig(fields, skin.sensor, skin.protocol)
    plan = plan_of_presses(20)
    header = Recording("guarded", "", "", skin.sensor, skin.protocol)
    recorder = Recorder(Path(sys.argv[1]), header, plan, skin.protocol.shape, counts=True)
    with guarded(fields["stage"], 0.01, 0.02):
        experiment = Experiment(rig, recorder, 0.0, lambda progress: print(progress.depth_m, flush=True))
        experiment.run(plan, surface_z_m=fields["geometry"]["origin_m"][2] - 7.3e-4)

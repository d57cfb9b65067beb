"""A live frame as one JSON object a line, in the shapes of ROS 2 messages.

``header`` is a ``std_msgs/Header``; ``contacts`` are ``geometry_msgs/Point`` ``position`` and ``geometry_msgs/Vector3``
``force``, in metres and newton in the skin's frame, z out of it, so that a press has a negative z; ``force_map`` is a
``std_msgs/Float64MultiArray`` over the taxels, their places being ``taxel_m``. Beside them ``frame``, ``latency_s``,
``rate_hz``, ``drift`` (in units of the noise), ``zeroing``, ``recorded_frames`` (null while nothing is recorded) and
``warnings``. Of a network that knows its skin (else null): ``novelty``, how unlike the frames it was trained on this
one is, beyond 1 by chance as often as ``novelty_false_alarms`` says; ``sheet_change``, relative, of the resting sheet
since its calibration. ``left``: whether the skin has left what was trained for. Stamps are of the system's time, of a
recording's own time where one is played.

Where the reader fails, a line holds ``header`` and ``fault``, what happened in words, and nothing else.
"""

from __future__ import annotations

import json

from ertskin.live.session import Array, LiveFrame
from ertskin.physics.calibration.following import FALSE_ALARMS

FRAME_ID = "skin"


def message_of(
    frame: LiveFrame, taxel_m: Array, epoch_s: float = 0.0, recorded_frames: int | None = None
) -> dict[str, object]:
    """The frame in plain types; ``epoch_s``: the system's time at the zero of the frame's clock."""
    taxels = len(frame.force_map_n)
    return {
        "header": _header(epoch_s + frame.time_s),
        "contacts": [
            {
                "position": {"x": round(contact.x_m, 6), "y": round(contact.y_m, 6), "z": 0.0},
                "force": {"x": 0.0, "y": 0.0, "z": -round(contact.force_n, 4)},
            }
            for contact in frame.contacts
        ],
        "force_map": {
            "layout": {"dim": [{"label": "taxel", "size": taxels, "stride": taxels}], "data_offset": 0},
            "data": [round(float(force), 4) for force in frame.force_map_n],
        },
        "taxel_m": taxel_m.round(6).tolist(),
        "frame": frame.number,
        "latency_s": round(frame.latency_s, 7),
        "rate_hz": round(frame.rate_hz, 3),
        "drift": round(frame.drift, 3),
        "zeroing": frame.zeroing,
        "novelty": None if frame.novelty is None else round(frame.novelty, 3),
        "novelty_false_alarms": None if frame.novelty is None else FALSE_ALARMS,
        "left": frame.left,
        "sheet_change": None if frame.sheet_change is None else round(frame.sheet_change, 6),
        "recorded_frames": recorded_frames,
        "warnings": frame.warnings,
    }


def fault_of(text: str, time_s: float) -> dict[str, object]:
    """What is said in place of a frame when there is none; ``time_s`` of the system."""
    return {"header": _header(time_s), "fault": text}


def line_of(message: dict[str, object]) -> str:
    """A message as a line of JSON, without its end."""
    return json.dumps(message, separators=(",", ":"))


def _header(time_s: float) -> dict[str, object]:
    second = int(time_s)
    return {"stamp": {"sec": second, "nanosec": int(1e9 * (time_s - second))}, "frame_id": FRAME_ID}

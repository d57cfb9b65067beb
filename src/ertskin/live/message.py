"""A live frame as one JSON object a line, in the shapes of ROS 2 messages.

``header`` is a ``std_msgs/Header``; ``contacts`` are ``geometry_msgs/Point`` ``position`` and ``geometry_msgs/Vector3``
``force``, in metres and newton in the skin's frame, z out of it, so that a press has a negative z; ``force_map`` is a
``std_msgs/Float64MultiArray`` over the taxels, their places being ``taxel_m``. Beside them ``frame``, ``latency_s``,
``rate_hz``, ``drift`` (in units of the noise) and ``warnings``.
"""

from __future__ import annotations

import json

from ertskin.live.session import Array, LiveFrame

FRAME_ID = "skin"


def message_of(frame: LiveFrame, taxel_m: Array) -> dict[str, object]:
    """The frame in plain types."""
    second = int(frame.time_s)
    taxels = len(frame.force_map_n)
    return {
        "header": {
            "stamp": {"sec": second, "nanosec": int(1e9 * (frame.time_s - second))},
            "frame_id": FRAME_ID,
        },
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
        "warnings": frame.warnings,
    }


def line_of(frame: LiveFrame, taxel_m: Array) -> str:
    """The frame as a line of JSON, without its end."""
    return json.dumps(message_of(frame, taxel_m), separators=(",", ":"))

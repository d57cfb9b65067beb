"""A figure as bytes, or as text that a page can hold inside itself."""

from __future__ import annotations

import base64
import io

from matplotlib.figure import Figure


def png(figure: Figure) -> bytes:
    """The figure as a PNG, the same bytes for the same drawing."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def data_uri(figure: Figure) -> str:
    """The PNG as a ``data:`` address."""
    return "data:image/png;base64," + base64.b64encode(png(figure)).decode()

"""A figure as bytes, or as text that a page can hold inside itself."""

from __future__ import annotations

import base64
import io
from pathlib import Path

from matplotlib.figure import Figure

from ertskin.files import write_whole


def png(figure: Figure) -> bytes:
    """The figure as a PNG, the same bytes for the same drawing."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def data_uri(content: bytes) -> str:
    """A PNG as a ``data:`` address."""
    return "data:image/png;base64," + base64.b64encode(content).decode()


def save_png(figure: Figure, path: Path) -> Path:
    """Write the PNG aside and rename it into place; returns ``path``."""
    return write_whole(path, png(figure))
